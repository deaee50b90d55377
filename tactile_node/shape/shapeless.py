"""Find contacts that may have formed by chance or from noise, such as specks, lines and checkerboards.

Taxels pressed at random form groups, which are larger where more taxels are pressed (site percolation). The density of
pressed taxels is measured beside the contact. The size and compactness of random groups were simulated for each
density, on 1,500 pads of 8x8 taxels, 1,500 pads of 16x16 taxels and 200 pads of 64x64 taxels. A real contact is
compact: most neighbours of its taxels also belong to the contact.
"""

import numpy as np

from tactile_node.contact.left_over import LEAST_COMPACTNESS
from tactile_node.contact.neighbours import box_of, grown
from tactile_node.contact.pattern import ContactPattern, number_contacts
from tactile_node.contact.press import are_on_off
from tactile_node.shape.patch import joined

#: Densities of pressed taxels beside a contact [fraction of the taxels beside it].
DENSITIES = (0.005, 0.02, 0.04, 0.06, 0.08, 0.10, 0.12, 0.16)
#: For each density, the size that groups formed by chance do not reach [taxels].
GROUPS = (4, 6, 9, 13, 16, 19, 22, 32)
#: Number of taxels on the pad for which GROUPS holds. On a larger pad, chance forms larger groups.
PLACES = 256
#: Relative increase of GROUPS on a pad with PLACES times as many taxels.
MORE_PLACES = 0.6
#: At this density and above, chance forms groups of any size, so only the compactness of a group counts.
DENSEST = 0.16
#: Smallest number of taxels with which another group counts as a contact, not as a speck.
OTHER = 6
#: Smallest compactness with which another group counts as a contact, not as a speck.
OTHER_COMPACT = 0.57
#: If at least this share of the pad lies outside the box around the contact, the density of specks is measured there.
AWAY = 0.25
#: Margin of the box around the contact [taxels].
MARGIN = 1
#: A large group must have a compactness of at least 1 - LOOSE / sqrt(taxels).
LOOSE = 1.7
#: A contact with at most this many taxels per row or column of its length counts as a line.
LINE_TAXELS = 1.2
#: Smallest length of a band of hum, as a share of the pad's width.
BAND_WIDTH = 0.4
#: A band is noise, not a bar, if the scatter of its readings is below this multiple of the scatter in other rows.
EVENNESS = 1.6
#: Hum shows as a second maximum of the row levels. The levels must rise to this maximum by more than this share of
#: their range.
ROW_RISE = 0.15
ROW_NOISE = 7.0  #: The rise of the row levels must also exceed this many standard deviations of a row's level.

#: Largest number of rows (or columns) of a string of pieces.
STRING = 4
#: Smallest length of a string of pieces, as a share of the pad's side.
LONG = 0.6
#: Distance from a contact at which the pressure must have fallen to the share STEEP [taxels].
FALL = 2
#: Increase of the distance FALL per taxel of the contact's width.
SLOPE = 0.1
#: Share of the contact's pressure to which the readings must have fallen at the distance FALL.
STEEP = 0.35
#: If more than this share of the taxels in a contact's rows or columns read far below rest, these lines are noisy.
BELOW_REST = 0.15
#: With fewer taxels per row away from the contact than this, it is unknown whether the rows show hum.
LINE = 3
#: At or above this density beside a contact, the contact needs the compactness AMONG_SPECKS.
SPECKLED = 0.08
AMONG_SPECKS = 0.55
#: A contact below this compactness counts as formed by chance if it is small (FEW, FEW_ALONE) or scattered (LARGEST).
RAGGED = 0.45
#: A contact is small if it has fewer taxels than this, including the pieces close to the contact.
FEW = 14
#: If nothing else is pressed on the pad, a contact is small if it has fewer taxels than this. Slim triangles of 9
#: taxels are also ragged, but must not be rejected.
FEW_ALONE = 7
#: A contact is scattered if its largest piece has less than this share of the taxels.
LARGEST = 0.4
#: A contact of fewer taxels than this is also judged together with its rim.
SMALL = 16
#: Lowest pressure in the rim of a small contact, as a share of the contact's mean.
PARTIAL = 0.25
#: A contact is cut by an edge of the pad if the number of its taxels at that edge exceeds this share of sqrt(taxels).
CUT_SHARE = 0.5
#: A contact that reaches three edges shows its width if it has at most this share of sqrt(taxels) at all edges
#: together. A corner taxel counts at two edges.
ACROSS_SHARE = 1.5
#: Smallest negative logarithm of the probability that all taxels of a compact contact are pressed by chance.
BEYOND_CHANCE = 15.0


def is_shapeless(pattern: ContactPattern) -> bool:
    """Return True if the contact may come from noise, stuck taxels, lines or drift.

    A contact is shapeless in these cases:

    - The contact is a group that may have formed by chance at the density of the pressed taxels beside it.
    - The contact is a line one taxel wide.
    - The contact reaches three edges of the pad with many taxels, so that its width is not seen.
    - The contact is a rise in the readings without an edge.
    - The contact is one piece of a noisy line, or a band of rows on a pad with hum.

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
    """Return True if the contact may have formed by chance at the density of the pressed taxels beside it."""
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
    is_loose = compactness < max(LEAST_COMPACTNESS, 1 - LOOSE / taxels ** 0.5)
    return bool(is_loose or taxels < BEYOND_CHANCE / -np.log(density))


def _wider(pattern: ContactPattern) -> ContactPattern:
    """Return a small contact extended by the partial pressures around it.

    In the result, other groups at the level of the partial pressures also count as contacts. A soft cover spreads a
    contact, but a speck has no partial pressures around it. Contacts of on/off taxels and large contacts are returned
    unchanged.
    """
    if np.count_nonzero(pattern.mask) >= SMALL or are_on_off(pattern.values):
        return pattern
    pressed = (pattern.values >= PARTIAL * np.nanmean(pattern.values[pattern.mask])) | pattern.mask
    labels, contacts = number_contacts(pressed, pattern.hidden)
    number = int(labels[pattern.mask].max())
    return pattern._replace(mask=labels == number, labels=labels, contacts=contacts,
                            sizes=tuple(np.bincount(labels.reshape(-1))[1:].tolist()))


def _is_line(taxels: np.ndarray) -> bool:
    """Return True if the contact is one taxel wide, like a faulty line or a chain of specks."""
    return bool(np.count_nonzero(taxels) <= LINE_TAXELS * max(_extents(taxels)))


def is_cut(contact: np.ndarray) -> bool:
    """Return True if an edge of the pad cuts a contact.

    >>> is_cut(np.eye(4, dtype=bool)), is_cut(np.eye(4) < 1)
    (False, True)
    """
    return any(edges_that_cut(contact))


def edges_that_cut(contact: np.ndarray) -> list[bool]:
    """Return for each edge of the pad whether it cuts a contact: first row, last row, first column, last column."""
    least = CUT_SHARE * float(np.count_nonzero(contact)) ** 0.5
    return [taxels > least for taxels in _taxels_at_edges(contact)]


def _taxels_at_edges(contact: np.ndarray) -> list[int]:
    return [int(np.count_nonzero(edge)) for edge in (contact[0], contact[-1], contact[:, 0], contact[:, -1])]


def _is_across(mask: np.ndarray) -> bool:
    """Return True if the contact reaches three edges of the pad with many of its taxels.

    A bar across the pad reaches only two edges and shows its width.
    """
    at_edges = _taxels_at_edges(mask)
    return sum(map(bool, at_edges)) >= 3 and sum(at_edges) > ACROSS_SHARE * float(np.count_nonzero(mask)) ** 0.5


def _is_string(mask: np.ndarray, together: np.ndarray) -> bool:
    """Return True if the contact is one of many pieces along a few rows or columns, such as noisy lines form."""
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

    In this case, the readings of the pad or of whole lines (hum) have risen without a contact.
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

    Rows of hum are as even as the other rows, and the row levels rise again away from the highest row. Along a bar, by
    contrast, the readings vary with the gains of the taxels and at the ends of the bar. Beside a bar, the pad is at
    rest.
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
    """Return True if the contact's rows also read more than ``most`` above ``rest`` elsewhere, or are noisy."""
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
    """Return the medians along the last axis, six times as fast as ``np.median``."""
    ordered, count = np.sort(values, -1), values.shape[-1]
    return (ordered[..., (count - 1) // 2] + ordered[..., count // 2]) / 2


def _median(values: np.ndarray) -> float:
    """Return the upper median, four times as fast as ``np.median``."""
    middle = values.size // 2
    return float(np.partition(values, middle)[middle])


def _density_beside(pattern: ContactPattern, together: np.ndarray) -> float:
    """Return the fraction of pressed taxels among the visible taxels away from the contact.

    Other contacts are excluded. One is added to the number of pressed taxels, because the absence of pressed taxels
    among only a few taxels proves little. If few other taxels are visible, the taxels around the pieces of a torn
    contact are also used.
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
