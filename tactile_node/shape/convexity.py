"""How much of its convex hull a contact fills: the five shapes are convex, hooks, bows and scattered pieces are not."""

import numpy as np
from scipy import ndimage

LEAST_CONVEXITY = 0.7  #: the five shapes fill more, gaps of speckle closed and rims filled; chosen on validation seeds
PARTIAL_LEVEL = 0.2     #: of the contact's mean, pressures that belong to it
#: directions in which the hull is measured, as columns of unit vectors
ANGLES = np.radians(np.arange(0.0, 180.0, 7.5))
AXES = np.stack((np.cos(ANGLES), np.sin(ANGLES)))
ROUNDING = 0.01         #: places within so much of the hull are in it [pitches]
EIGHT_CONNECTED = np.ones((3, 3), bool)


def is_convex(values: np.ndarray, mask: np.ndarray) -> bool:
    """Return whether the contact ``mask`` of a frame ``values`` fills its hull as one of the five shapes does.

    ``mask``: bool, both (rows, cols). Taxels without a value belong to no notch, and what a rim and one edge of the pad
    enclose is filled.

    >>> bar = np.zeros((20, 20))
    >>> bar[9:12, 2:18] = 1
    >>> hook = bar.copy()
    >>> hook[2:9, 2:5] = 1
    >>> is_convex(bar, bar > 0), is_convex(hook, hook > 0)
    (True, False)
    """
    with np.errstate(invalid='ignore'):
        wide = mask | (values >= PARTIAL_LEVEL * np.nanmean(values[mask]))
    labels = ndimage.label(wide, EIGHT_CONNECTED)[0]
    wide = np.isin(labels, np.unique(labels[mask]))
    rows, cols = np.flatnonzero(wide.any(1)), np.flatnonzero(wide.any(0))
    box = slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1)
    inside, unseen = wide[box], np.isnan(values[box])
    if np.count_nonzero(inside) >= LEAST_CONVEXITY * inside.size:  # quick: the hull is in the box
        return True
    closed = inside | ndimage.binary_closing(np.pad(inside, 2), EIGHT_CONNECTED)[2:-2, 2:-2]
    at_edge = rows[0] == 0, rows[-1] == mask.shape[0] - 1, cols[0] == 0, cols[-1] == mask.shape[1] - 1
    in_hull = _hull(closed) & ~(unseen & ~closed)
    filled = closed | _holes(closed | unseen, at_edge)
    return bool(np.count_nonzero(filled & in_hull) >= LEAST_CONVEXITY * np.count_nonzero(in_hull))


def _holes(rim: np.ndarray, at_edge: tuple[bool, bool, bool, bool]) -> np.ndarray:
    """Return what ``rim`` encloses, alone or with one edge of the pad: the first row, the last, columns."""
    filled = ndimage.binary_fill_holes(rim)
    framed = np.pad(rim, 1)
    for edge, is_touched in zip(((0, ...), (-1, ...), (..., 0), (..., -1)), at_edge):
        if is_touched:
            closed = framed.copy()
            closed[edge] = True
            filled |= ndimage.binary_fill_holes(closed)[1:-1, 1:-1]
    holes: np.ndarray = filled & ~rim
    return holes


def _hull(mask: np.ndarray) -> np.ndarray:
    """Return the taxels whose centres are in the hull of the centres of ``mask``."""
    row, col = np.nonzero(mask)
    along = np.stack((col, row), 1) @ AXES
    row, col = np.indices(mask.shape).reshape(2, -1)
    every = np.stack((col, row), 1) @ AXES
    within: np.ndarray = ((every >= along.min(0) - ROUNDING) & (every <= along.max(0) + ROUNDING)).all(1)
    return within.reshape(mask.shape)
