"""Whether a contact is more than chance: specks, lines and checkerboards have no shape.

Taxels that are pressed at random make groups, the larger the denser they are (site percolation). How dense they are
shows beside the contact; how large and how compact such groups become was found by drawing 1,500 pads of 8x8 and 16x16
taxels and 200 of 64x64 for each density. Contacts are compact: their taxels have their neighbours in the contact.
"""

import numpy as np

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
BAND_WIDTH = 0.4   #: of the pad's width, the least that hum shows of a row
EVENNESS = 1.6     #: times the deviation along other rows: less along a band's is their noise, no bar
ROW_RISE, ROW_NOISE = 0.15, 7.0  #: of the highest row's level, and deviations of a row's median: hum is more
STRING, LONG = 4, 0.6  #: rows of a string of pieces at most, and its length at least [of the pad's side]
FALL, SLOPE = 2, 0.1   #: so many taxels beside a contact, and by this part of its width more, its pressure has fallen
STEEP = 0.35       #: to this part of it, or less
BELOW_REST = 0.15  #: of the taxels on a contact's lines: where more read as far below the rest, the lines are noisy
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
    return bool(_median(pattern.values[beside]) - rest > most
                or _lines_rise(pattern.values, together, away, rest, most)
                or _lines_rise(pattern.values.T, together.T, away.T, rest, most))


def _is_hum(pattern: ContactPattern) -> bool:
    """Return whether the contact is a band of whole rows or columns on a pad whose other rows or columns move, too."""
    turned = (pattern.values, pattern.mask), (pattern.values.T, pattern.mask.T)
    return any(np.count_nonzero(mask.any(0)) >= BAND_WIDTH * mask.shape[1] and _is_band_of_hum(values, mask)
               for values, mask in turned)


def _is_band_of_hum(values: np.ndarray, mask: np.ndarray) -> bool:
    """Return whether the rows of ``mask`` are as even as the others, and levels rise again away from the highest row.

    Along a bar the readings vary by the gain of its taxels and by its ends, and beyond its flanks the pad rests.
    """
    finite, band = np.isfinite(values), np.asarray(mask.any(1))
    is_whole = np.count_nonzero(finite) == finite.size
    if not is_whole:
        seen = finite.any(1)
        values, band = values[seen], band[seen]
    of_band = np.count_nonzero(band)
    if not 0 < of_band < band.size:
        return False
    spread = values.std(1) if is_whole else np.nanstd(values, axis=1)
    noise = float(_medians(spread[~band]))
    if not np.square(spread[band]).sum() / of_band < (EVENNESS * noise) ** 2:
        return False
    levels = _medians(values) if is_whole else np.nanmedian(values, axis=1)
    peak = int(levels.argmax())
    least = max(ROW_RISE * float(np.ptp(levels)), ROW_NOISE * noise / values.shape[1] ** 0.5)
    return any(bool((side - np.minimum.accumulate(side) > least).any()) for side in (levels[peak:], levels[peak::-1]))


def _lines_rise(values: np.ndarray, taxels: np.ndarray, away: np.ndarray, rest: float, most: float) -> bool:
    """Return whether the rows of the contact read more than ``most`` above ``rest`` away from it, too, or below it."""
    rows_of_contact, _ = box_of(taxels)
    lines = values[rows_of_contact]
    if np.count_nonzero(lines < rest - most) > BELOW_REST * lines.size:
        return True
    used = away[rows_of_contact]
    count = np.count_nonzero(used)
    if count < LINE * len(used):
        return False
    along = lines[used] - rest
    return bool(along.sum() > most * count and _median(along) > most)  # the sum is the quicker


def _medians(values: np.ndarray) -> np.ndarray:
    """Return the medians along the last axis; numpy's own take six times as long."""
    ordered, count = np.sort(values, -1), values.shape[-1]
    return (ordered[..., (count - 1) // 2] + ordered[..., count // 2]) / 2


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
    away = visible.copy()
    away[box_of(together, MARGIN)] = False
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


def _compactness(mask: np.ndarray) -> float:
    """Return the fraction of the taxels' sides that have a taxel of ``mask`` beyond them."""
    inner = np.count_nonzero(mask[1:] & mask[:-1]) + np.count_nonzero(mask[:, 1:] & mask[:, :-1])
    return float(inner / (2 * np.count_nonzero(mask)))
