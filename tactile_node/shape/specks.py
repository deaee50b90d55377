"""Whether a contact is more than chance: specks, lines and checkerboards have no shape.

Taxels that are pressed at random make groups, the larger the denser they are (site percolation). How dense they are
shows beside the contact; how large and how compact such groups become was found by drawing 1,500 pads of 8x8 and 16x16
taxels and 200 of 64x64 for each density. Contacts are compact: their taxels have their neighbours in the contact.
"""

import numpy as np

from tactile_node.contact.neighbours import grown
from tactile_node.contact.pattern import ContactPattern
from tactile_node.shape.patch import joined

#: Fraction of the taxels beside the contact that are pressed -> taxels of a group that chance does not make there.
DENSITIES = (0.005, 0.02, 0.04, 0.06, 0.08, 0.10, 0.12, 0.16)
GROUPS = (4, 6, 9, 13, 16, 19, 22, 32)
DENSEST = 0.16     #: from here on groups of any size are made by chance, and only compactness counts
OTHER = 6          #: taxels of another contact, which is no speck
OTHER_COMPACT = 0.57  #: compactness of such a contact
AWAY = 0.25        #: of the pad: so much beyond the box around the contact shows the density of specks
MARGIN = 1         #: taxels around that box
COMPACT = 0.62     #: compactness that chance does not reach, for small groups
LOOSE = 1.7        #: large groups are more compact: 1 - LOOSE / sqrt(taxels)
THIN = 1.7         #: width of a line [taxels]: one taxel, and up to 1.5 where it lies obliquely
ACROSS = 2.5       #: width of a bar across the whole pad, whose ends are not seen [taxels]


def is_by_chance(pattern: ContactPattern) -> bool:
    """Return whether the contact of ``pattern`` is what noise, stuck taxels or lines make, too.

    That is a group of the size that chance makes at the density of the pressed taxels beside it, a line one taxel
    wide, or a thin bar from edge to edge, whose ends are not seen.

    >>> diagonal = np.eye(8, dtype=bool)
    >>> is_by_chance(ContactPattern.of(diagonal, diagonal.astype(float)))
    True
    """
    mask = pattern.mask
    taxels = int(np.count_nonzero(mask))
    together = joined(pattern)
    if np.count_nonzero(together) < GROUPS[0]:
        return False  # too small for a shape anyway
    if _is_line(together):
        return True
    density = _density_beside(pattern, together)
    if density < DENSEST and taxels >= np.interp(density, DENSITIES, GROUPS):
        return False
    return bool(_compactness(mask) < max(COMPACT, 1 - LOOSE / taxels ** 0.5))


def _is_line(taxels: np.ndarray) -> bool:
    """Return whether the contact is one taxel wide, or thin and reaches from edge to edge of the pad."""
    rows, cols = taxels.shape
    y, x = np.nonzero(taxels)
    dy, dx = y - y.mean(), x - x.mean()
    yy, xx, xy = dy @ dy / len(y), dx @ dx / len(y), dy @ dx / len(y)
    narrowest = (yy + xx) / 2 - np.hypot((yy - xx) / 2, xy)
    width = (12 * max(float(narrowest), 0.0) + 1) ** 0.5  # of a bar with this second moment, of whole taxels
    is_across = y.min() == 0 and y.max() == rows - 1 or x.min() == 0 and x.max() == cols - 1
    return bool(width < (ACROSS if is_across else THIN))


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
        for number, taxels in enumerate(pattern.sizes[1:], 2):
            if taxels < OTHER:
                break
            other = pattern.labels == number
            if _compactness(other) >= OTHER_COMPACT:
                away &= ~grown(other)
        pressed &= away
    return (int(np.count_nonzero(pressed)) + 1) / (int(np.count_nonzero(away)) + 2)


def _box_around(taxels: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return the taxels of the least box around ``taxels`` and MARGIN more."""
    rows, cols = np.flatnonzero(taxels.any(1)), np.flatnonzero(taxels.any(0))
    box = np.zeros(shape, bool)
    box[max(rows[0] - MARGIN, 0):rows[-1] + MARGIN + 1, max(cols[0] - MARGIN, 0):cols[-1] + MARGIN + 1] = True
    return box


def _compactness(mask: np.ndarray) -> float:
    """Return the fraction of the taxels' sides that have a taxel of ``mask`` beyond them."""
    inner = np.count_nonzero(mask[1:] & mask[:-1]) + np.count_nonzero(mask[:, 1:] & mask[:, :-1])
    return float(inner / (2 * np.count_nonzero(mask)))
