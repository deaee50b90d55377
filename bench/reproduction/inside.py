"""N read as the number of inside taxels (the paper's Fig. 1 and section 7), not of all active ones."""

import numpy as np

from tactile_node.helmholtz.operators import Stencil, border
from tactile_node.teaching.curve_fitting import COLUMNS, Samples

ACTIVE = COLUMNS[0]  #: the number of active taxels, N by the matrix A
INSIDE = ('value', 'inside')  #: the number of inside taxels
GROWTH = (0.7, 3.6)  #: √area grows by more and by less than this from a pattern's inside to the whole [pitches]


def count_inside(mask: np.ndarray) -> int:
    """Return how many active taxels of ``mask``, bool, shape (rows, cols), are inside: N - P05.

    >>> count_inside(np.ones((3, 4), bool))
    2
    """
    return int(mask.sum() - border(mask, Stencil.FIVE).sum())


def areas_around(inside: int) -> tuple[float, float]:
    """Return the least and the greatest area [taxels] at which a class may have so many inside taxels.

    The border takes 0.7 to 1 pitch from each side, by its direction, so that √area of a polygon around a circle
    shrinks by as much times perimeter / (2 √area): 1.3 for a circle, at most 2.8 for a right triangle of legs 5:2.
    GROWTH leaves room for how a pattern lies on the lattice, 0.4 in 60,000 patterns.
    """
    least, most = ((np.sqrt(inside) + growth) ** 2 for growth in GROWTH)
    return float(least), float(most)


def by_inside(samples: Samples) -> Samples:
    """Return ``samples`` with inside taxels in the place of N, so that plane 1 is drawn over them."""
    return Samples({**samples.columns, ACTIVE: samples.of(INSIDE)}, samples.labels)
