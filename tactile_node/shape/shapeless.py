"""Find contacts that chance or noise may have formed: specks, lines and checkerboards have no shape.

Taxels that are pressed at random form groups. The groups are larger where more taxels are pressed (site percolation).
The density of pressed taxels is measured beside the contact. The size and compactness of random groups come from
simulations: 1,500 pads of 8x8 and of 16x16 taxels and 200 pads of 64x64 taxels for each density. Real contacts are
compact, which means that most neighbours of their taxels also belong to the contact.
"""

import numpy as np

from tactile_node.contact.left_over import LEAST_COMPACTNESS
from tactile_node.contact.neighbours import box_of, grown
from tactile_node.contact.pattern import ContactPattern, number_contacts
from tactile_node.contact.press import are_on_off
from tactile_node.shape.patch import joined

#: Densities of pressed taxels beside a contact [fraction of these taxels].
DENSITIES = (0.005, 0.02, 0.04, 0.06, 0.08, 0.10, 0.12, 0.16)
#: For each density, the size from which on chance does not form a group [taxels].
GROUPS = (4, 6, 9, 13, 16, 19, 22, 32)
#: Number of taxels of the pad for which GROUPS holds. On a larger pad, chance forms larger groups.
PLACES = 256
#: Increase of GROUPS on a pad with PLACES times as many taxels, as a share.
MORE_PLACES = 0.6
#: From this density on, chance forms groups of any size, and only their compactness counts.
DENSEST = 0.16
#: Smallest number of taxels of another contact that is not a speck.
OTHER = 6
#: Smallest compactness of such a contact.
OTHER_COMPACT = 0.57
#: Share of the pad. If at least this share lies outside the box around the contact, it shows the density of specks.
AWAY = 0.25
#: Margin of that box [taxels].
MARGIN = 1
#: Required compactness of large groups: 1 - LOOSE / sqrt(taxels).
LOOSE = 1.7
#: Largest number of taxels of a line per row or column of its length.
LINE_TAXELS = 1.2
#: Smallest length of a band of hum, as a share of the pad's width.
BAND_WIDTH = 0.4
#: A band is noise, not a bar, if its readings scatter less than this many times as much as those of other rows.
EVENNESS = 1.6
#: Hum shows as a second maximum of the rows' levels. The levels must rise to it by more than this share of their range.
ROW_RISE = 0.15
ROW_NOISE = 7.0  #: The rise must also exceed this many standard deviations of a row's level.
#: Largest number of rows (or columns) of a string of pieces.
STRING = 4
#: Smallest length of a string of pieces, as a share of the pad's side.
LONG = 0.6
#: Distance from a contact at which its pressure must have fallen [taxels].
FALL = 2
#: Increase of this distance with the width of the contact.
SLOPE = 0.1
#: Share of the contact's pressure to which it must have fallen at this distance.
STEEP = 0.35
#: Share of the taxels in the rows or columns of a contact. If more taxels read far below rest, these lines are noisy.
BELOW_REST = 0.15
#: Average number of taxels of a row away from the contact. With fewer taxels, it is not known whether the row hums.
LINE = 3
#: If the density beside a contact is this high, the contact needs the compactness AMONG_SPECKS.
SPECKLED = 0.08
AMONG_SPECKS = 0.55
#: A contact below this compactness counts as chance if it is small (FEW, FEW_ALONE) or scattered (LARGEST).
RAGGED = 0.45
#: Small means fewer taxels than this, counting the pieces close to the contact.
FEW = 14
#: If nothing else is pressed on the pad, small means fewer taxels than this. Slim triangles of 9 taxels are ragged,
#: too, and must not be rejected.
FEW_ALONE = 7
#: Scattered means that less than this share of the taxels is in the largest piece.
LARGEST = 0.4
#: A contact of fewer taxels than this is also judged together with its rim.
SMALL = 16
#: Lowest pressure of that rim, as a share of the contact's mean.
PARTIAL = 0.25
#: Smallest -log of the probability that chance presses all taxels of a compact contact.
SURE = 15.0


def is_shapeless(pattern: ContactPattern) -> bool:
    """Return True if the contact may come from noise, stuck taxels, lines or drift.

    A contact is shapeless in these cases:

    - It is a group that chance may form at the density of the pressed taxels beside it.
    - It is a line one taxel wide.
    - It reaches three edges of the pad, so that its width is not seen.
    - It is a rise of the readings without an edge.
    - It is one piece of a noisy line, or a band of rows on a pad that hums.

    >>> row = np.eye(8, dtype=bool)[[3] * 8].T
    >>> is_shapeless(ContactPattern.of(row, row.astype(float)))
    True
    """
    together = joined(pattern)
    if np.count_nonzero(together) < GROUPS[0]:
        return False  # the recogniser rejects a contact of this size in any case
    if (_is_line(together) or _is_across(pattern.mask) or _is_string(pattern.mask, together)
            or _is_rise(pattern, together) or _is_hum(pattern)):
        return True
    if not _is_chance(pattern, together):
        return False
    wider = _wider(pattern)
    return wider is pattern or _is_chance(wider, joined(wider))


def _is_chance(pattern: ContactPattern, together: np.ndarray) -> bool:
    """Return True if chance may form such a group at the density of the pressed taxels beside it."""
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
    """Return a small contact extended by the partial pressures around it.

    Other groups that reach the level of these pressures then count as contacts, too. A soft cover spreads a contact,
    but a speck has nothing around it. On/off taxels and large contacts stay as they are.
    """
    if np.count_nonzero(pattern.mask) >= SMALL or are_on_off(pattern.values):
        return pattern
    pressed = (pattern.values >= PARTIAL * np.nanmean(pattern.values[pattern.mask])) | pattern.mask
    labels, contacts = number_contacts(pressed, pattern.hidden)
    number = int(labels[pattern.mask].max())
    return pattern._replace(mask=labels == number, labels=labels, contacts=contacts,
                            sizes=tuple(np.bincount(labels.reshape(-1))[1:].tolist()))


def _is_line(taxels: np.ndarray) -> bool:
    """Return True if the contact is one taxel wide: it is a bad line or a chain of specks."""
    return bool(np.count_nonzero(taxels) <= LINE_TAXELS * max(_extents(taxels)))


def _is_across(mask: np.ndarray) -> bool:
    """Return True if the contact reaches three edges of the pad.

    A bar across the pad reaches only two edges and shows its width.
    """
    return sum(bool(edge.any()) for edge in (mask[0], mask[-1], mask[:, 0], mask[:, -1])) >= 3


def _is_string(mask: np.ndarray, together: np.ndarray) -> bool:
    """Return True if the contact is one of many pieces along a few rows or columns, as noisy lines form them."""
    (high, wide), extents = _extents(together), _extents(mask)
    longest = max(high, wide)
    return bool(min(high, wide) <= STRING and longest >= LONG * together.shape[0 if high > wide else 1]
                and max(extents) < longest / 2)


def _extents(taxels: np.ndarray) -> tuple[int, int]:
    """Return the number of rows and columns of the smallest box around the taxels."""
    rows, cols = box_of(taxels)
    return rows.stop - rows.start, cols.stop - cols.start


def _is_rise(pattern: ContactPattern, together: np.ndarray) -> bool:
    """Return True if the pressures do not fall off around the contact, or do not fall off along its rows or columns.

    The readings of the pad, or of whole lines (hum), have then risen without a contact.
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
    """Return True if the contact is a band of whole rows or columns on a pad where other lines also fluctuate."""
    turned = (pattern.values, pattern.mask), (pattern.values.T, pattern.mask.T)
    return any(np.count_nonzero(mask.any(0)) >= BAND_WIDTH * mask.shape[1] and _is_band_of_hum(values, mask)
               for values, mask in turned)


def _is_band_of_hum(values: np.ndarray, mask: np.ndarray) -> bool:
    """Return True if the rows of the contact are a band of hum.

    They are as even as the other rows, and the levels rise again away from the highest row. Along a bar, the readings
    vary with the gain of its taxels and at its ends. Beside a bar, the pad is at rest.
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
    """Return True if, away from the contact, its rows also read more than ``most`` above ``rest``, or far below it."""
    rows_of_contact, _ = box_of(taxels)
    lines = values[rows_of_contact]
    if np.count_nonzero(lines < rest - most) > BELOW_REST * lines.size:
        return True
    used = away[rows_of_contact]
    count = np.count_nonzero(used)
    if count < LINE * len(used):
        return False
    along = lines[used] - rest
    return bool(along.sum() > most * count and _median(along) > most)  # the sum is faster to compute


def _medians(values: np.ndarray) -> np.ndarray:
    """Return the medians along the last axis; six times as fast as numpy's."""
    ordered, count = np.sort(values, -1), values.shape[-1]
    return (ordered[..., (count - 1) // 2] + ordered[..., count // 2]) / 2


def _median(values: np.ndarray) -> float:
    """Return the upper median; four times as fast as numpy's median."""
    middle = values.size // 2
    return float(np.partition(values, middle)[middle])


def _density_beside(pattern: ContactPattern, together: np.ndarray) -> float:
    """Return the fraction of pressed taxels among the visible taxels away from the contact.

    Other contacts are left out. The number of pressed taxels is rounded up by one, because no pressed taxel among a few
    says little. If little else is seen, the taxels around the pieces of a torn contact are used as well.
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
    """Return the fraction of the taxels' sides at which ``mask`` has another taxel."""
    inner = np.count_nonzero(mask[1:] & mask[:-1]) + np.count_nonzero(mask[:, 1:] & mask[:, :-1])
    return float(inner / (2 * np.count_nonzero(mask)))
