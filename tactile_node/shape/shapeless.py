"""Whether a contact is more than chance: specks, lines and checkerboards have no shape.

Taxels that are pressed at random make groups, the larger the denser they are (site percolation). How dense they are
shows beside the contact; how large and how compact such groups become was found by drawing 1,500 pads of 8x8 and 16x16
taxels and 200 of 64x64 for each density. Contacts are compact: their taxels have their neighbours in the contact.
"""

import numpy as np
from scipy import ndimage

from tactile_node.contact.left_over import LEAST_COMPACTNESS
from tactile_node.contact.neighbours import box_of, grown
from tactile_node.contact.pattern import ContactPattern, number_contacts
from tactile_node.contact.press import are_on_off
from tactile_node.shape.patch import joined

#: Fraction of the taxels beside the contact that are pressed -> taxels of a group that chance does not make there.
DENSITIES = (0.005, 0.02, 0.04, 0.06, 0.08, 0.10, 0.12, 0.16)
GROUPS = (4, 6, 9, 13, 16, 19, 22, 32)
PLACES = 256       #: taxels of the pad for which GROUPS holds; there is more chance on larger ones:
MORE_PLACES = 0.6  #: groups are larger by this part where there are PLACES times as many
DENSEST = 0.16     #: from here on groups of any size are made by chance, and only compactness counts
OTHER = 6          #: taxels of another contact, which is no speck
OTHER_COMPACT = 0.57  #: compactness of such a contact
AWAY = 0.25        #: of the pad: so much beyond the box around the contact shows the density of specks
MARGIN = 1         #: taxels around that box
LOOSE = 1.7        #: large groups are more compact: 1 - LOOSE / sqrt(taxels)
LINE_TAXELS = 1.2  #: taxels of a line at most, for each of the rows or columns along which it lies
HUM, ROW_NOISE = 0.03, 6.0  #: of a band's level, and deviations of a row's median: rows that read another level move
MOVING = 0.3       #: of the rows away from a band: where so many move, the pad hums
STRING, LONG = 4, 0.6  #: rows of a string of pieces at most, and its length at least [of the pad's side]
FALL, SLOPE = 2, 0.1   #: so many taxels beside a contact, and by this part of its width more, its pressure has fallen
STEEP = 0.35       #: to this part of it, or less
SCATTER = 0.8      #: of that part, the median deviation along lines that are too noisy to show a contact
LINE = 3           #: taxels of a row away from the contact, on average: fewer do not show whether it hums
SPECKLED = 0.08    #: where so many taxels beside a contact are pressed,
AMONG_SPECKS = 0.55  #: it is none below this compactness
RAGGED = 0.45      #: nor below this one where
FEW = 14           #: it is of fewer taxels, with the pieces close to it,
FEW_ALONE = 7      #: where nothing else is pressed of fewer than these (slim triangles of 9 taxels are ragged), or
LARGEST = 0.4      #: less than this part of them is in one piece
SMALL, PARTIAL = 16, 0.25  #: taxels of a contact so small that its rim counts, and the level of that rim
SURE = 15.0        #: -log of the probability that chance presses all taxels of a compact contact


def is_shapeless(pattern: ContactPattern) -> bool:
    """Return whether the contact of ``pattern`` is what noise, stuck taxels, lines or drift make, too.

    That is a group of the size that chance makes at the density of the pressed taxels beside it, a line one taxel
    wide, what reaches three edges of the pad, so that its width is not seen, and a rise without an edge.

    >>> row = np.eye(8, dtype=bool)[[3] * 8].T
    >>> is_shapeless(ContactPattern.of(row, row.astype(float)))
    True
    """
    together = joined(pattern)
    if np.count_nonzero(together) < GROUPS[0]:
        return False  # too small for a shape anyway
    if (_is_line(together) or _is_across(pattern.mask) or _is_string(pattern.mask, together)
            or _is_rise(pattern, together) or _is_hum(pattern)):
        return True
    if not _is_chance(pattern, together):
        return False
    wider = _wider(pattern)
    return wider is pattern or _is_chance(wider, joined(wider))


def _is_chance(pattern: ContactPattern, together: np.ndarray) -> bool:
    """Return whether chance makes such a group at the density of the pressed taxels beside it."""
    taxels, whole = int(np.count_nonzero(pattern.mask)), np.count_nonzero(together)
    density, compactness = _density_beside(pattern, together), _compactness(pattern.mask)
    if density >= SPECKLED and compactness < AMONG_SPECKS:
        return True
    few = FEW if pattern.contacts > 1 else FEW_ALONE
    if compactness < RAGGED and (whole < few or taxels < LARGEST * whole):
        return True
    places = max(np.log(pattern.mask.size / PLACES) / np.log(PLACES), 0.0)
    if density < DENSEST and taxels >= np.interp(density, DENSITIES, GROUPS) * (1 + MORE_PLACES * places):
        return False
    return bool(taxels < SURE / -np.log(density) or compactness < max(LEAST_COMPACTNESS, 1 - LOOSE / taxels ** 0.5))


def _wider(pattern: ContactPattern) -> ContactPattern:
    """Return a small contact with the partial pressures around it, and what else reaches their level.

    A soft cover spreads a contact; a speck has nothing around it. On/off taxels, and large contacts, stay as they are.
    """
    if np.count_nonzero(pattern.mask) >= SMALL or are_on_off(pattern.values):
        return pattern
    pressed = (pattern.values >= PARTIAL * np.nanmean(pattern.values[pattern.mask])) | pattern.mask
    labels, contacts = number_contacts(pressed, pattern.hidden)
    number = int(labels[pattern.mask].max())
    return pattern._replace(mask=labels == number, labels=labels, contacts=contacts,
                            sizes=tuple(np.bincount(labels.reshape(-1))[1:].tolist()))


def _is_line(taxels: np.ndarray) -> bool:
    """Return whether the contact is one taxel wide: a bad line, or a chain of specks."""
    return bool(np.count_nonzero(taxels) <= LINE_TAXELS * max(_extents(taxels)))


def _is_across(mask: np.ndarray) -> bool:
    """Return whether the contact reaches three edges of the pad; a bar across it reaches two, and shows its width."""
    return sum(bool(edge.any()) for edge in (mask[0], mask[-1], mask[:, 0], mask[:, -1])) >= 3


def _is_string(mask: np.ndarray, together: np.ndarray) -> bool:
    """Return whether the contact is one of many pieces along a few rows or columns: noisy lines."""
    (high, wide), extents = _extents(together), _extents(mask)
    longest = max(high, wide)
    return bool(min(high, wide) <= STRING and longest >= LONG * together.shape[0 if high > wide else 1]
                and max(extents) < longest / 2)


def _extents(taxels: np.ndarray) -> tuple[int, int]:
    """Rows and columns of the least box around them."""
    rows, cols = box_of(taxels)
    return rows.stop - rows.start, cols.stop - cols.start


def _is_rise(pattern: ContactPattern, together: np.ndarray) -> bool:
    """Return whether pressures do not fall off around the contact, or not along its rows or columns.

    It is a rise of the pad's readings, or of whole lines (hum), no contact.
    """
    near = together
    for _ in range(FALL + int(SLOPE * np.count_nonzero(together) ** 0.5)):
        inner, near = near, grown(near)
    visible = ~(pattern.hidden | pattern.unmapped)
    beside, away = near & ~inner & visible, visible & ~near
    if not beside.any():
        return False
    rest = _median(pattern.values[away]) if away.any() else 0.0
    most = STEEP * (float(pattern.values[together & visible].mean()) - rest)
    quiet = away & (pattern.labels == 0)
    return _median(pattern.values[beside]) - rest > most or any(
        _lines_rise(*turned, rest, most) for turned in (
            (pattern.values, together, away, quiet), (pattern.values.T, together.T, away.T, quiet.T)))


def _is_hum(pattern: ContactPattern) -> bool:
    """Return whether the contact is a band of rows or columns from edge to edge, and others move, too."""
    along = [bool(mask[:, 0].any() and mask[:, -1].any()) for mask in (pattern.mask, pattern.mask.T)]
    if not any(along):
        return False
    values = np.where(pattern.hidden | pattern.unmapped, np.nan, pattern.values)
    return along[0] and _others_move(values, pattern.mask) or along[1] and _others_move(values.T, pattern.mask.T)


def _others_move(values: np.ndarray, band: np.ndarray) -> bool:
    """Return whether many rows away from those of ``band`` read another level than the rest, beyond their noise."""
    away = ~ndimage.binary_dilation(band.any(1)) & np.isfinite(values).any(1)
    if np.count_nonzero(away) < LINE:
        return False
    medians = np.nanmedian(values[away], axis=1)
    noise = np.nanmedian(np.abs(values[away] - medians[:, None]), axis=1) / values.shape[1] ** 0.5
    rest = float(np.median(medians))
    least = HUM * (float(np.nanmean(values[band])) - rest)
    return bool(np.mean(np.abs(medians - rest) > np.maximum(least, ROW_NOISE * noise)) > MOVING)


def _lines_rise(values: np.ndarray, taxels: np.ndarray, away: np.ndarray, quiet: np.ndarray, rest: float,
                most: float) -> bool:
    """Return whether the rows of the contact read more than ``most`` above ``rest`` away from it, too, or scatter.

    ``quiet``: taxels away from it that are not pressed; they show the noise of these rows.
    """
    rows_of_contact, _ = box_of(taxels)
    used = quiet[rows_of_contact]
    if np.count_nonzero(used) >= LINE and _median(np.abs(values[rows_of_contact][used] - rest)) > SCATTER * most:
        return True
    used = away[rows_of_contact]
    count = np.count_nonzero(used)
    if count < LINE * len(used):
        return False
    along = values[rows_of_contact][used] - rest
    return bool(along.sum() > most * count and _median(along) > most)  # the sum is the quicker


def _median(values: np.ndarray) -> float:
    """Return the upper median (a quarter of the time of numpy's)."""
    middle = values.size // 2
    return float(np.partition(values, middle)[middle])


def _density_beside(pattern: ContactPattern, together: np.ndarray) -> float:
    """Return the fraction of the visible taxels away from the contact that are pressed, other contacts left out.

    Rounded up by one taxel: of a few taxels, none pressed says little. What lies around the pieces of a torn contact
    counts where little else is seen.
    """
    visible = ~(pattern.hidden | pattern.unmapped)
    away = visible & ~_box_around(together, visible.shape)
    if np.count_nonzero(away) < AWAY * visible.size:
        away = visible & ~grown(pattern.mask)
    pressed = (pattern.labels > 0) & away
    if pressed.any():
        for number, taxels in enumerate(pattern.sizes, 1):
            if taxels < OTHER:
                break
            other = pattern.labels == number
            if not (other & pattern.mask).any() and _compactness(other) >= OTHER_COMPACT:
                away &= ~grown(other)
        pressed &= away
    return (int(np.count_nonzero(pressed)) + 1) / (int(np.count_nonzero(away)) + 2)


def _box_around(taxels: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return the taxels of the least box around ``taxels`` and MARGIN more."""
    rows, cols = box_of(taxels)
    box = np.zeros(shape, bool)
    box[max(rows.start - MARGIN, 0):rows.stop + MARGIN, max(cols.start - MARGIN, 0):cols.stop + MARGIN] = True
    return box


def _compactness(mask: np.ndarray) -> float:
    """Return the fraction of the taxels' sides that have a taxel of ``mask`` beyond them."""
    inner = np.count_nonzero(mask[1:] & mask[:-1]) + np.count_nonzero(mask[:, 1:] & mask[:, :-1])
    return float(inner / (2 * np.count_nonzero(mask)))
