"""How much of its convex hull a contact fills: the five shapes are convex, hooks, bows and scattered pieces are not."""

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED, box_of, reached

LEAST_CONVEXITY = 0.7  #: the five shapes fill more, gaps of speckle closed and rims filled; chosen on validation seeds
PARTIAL_LEVEL = 0.2     #: share of the contact's mean, pressures that belong to it
#: directions in which the hull is measured, as columns of unit vectors
HULL_ANGLES = np.radians(np.arange(0.0, 180.0, 7.5))
HULL_AXES = np.stack((np.cos(HULL_ANGLES), np.sin(HULL_ANGLES)))
HULL_ROUNDING = 0.01         #: places within so much of the hull are in it [pitches]


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
    if _fills(mask, box_of(mask)):
        return True
    unseen = np.isnan(values)
    pressures = values[mask & ~unseen]
    wide = mask | (np.where(unseen, 0.0, values) >= PARTIAL_LEVEL * float(pressures.mean()))
    wide = reached(mask, wide)
    rows, cols = box_of(wide)
    inside, unseen = wide[rows, cols], unseen[rows, cols]
    hull = _hull(inside)
    if _fills(inside, hull & ~(unseen & ~inside)):
        return True
    closed = inside | ndimage.binary_closing(np.pad(inside, 2), EIGHT_CONNECTED)[2:-2, 2:-2]
    at_edge = (rows.start == 0, rows.stop == mask.shape[0], cols.start == 0, cols.stop == mask.shape[1])
    return _fills(closed | _holes(closed | unseen, at_edge), hull & ~(unseen & ~closed))


def _fills(taxels: np.ndarray, hull: np.ndarray | tuple[slice, slice]) -> bool:
    """Return whether ``taxels`` are LEAST_CONVEXITY of ``hull``, bool (rows, cols), or of a box of rows and columns."""
    part = taxels[hull]
    return bool(np.count_nonzero(part) >= LEAST_CONVEXITY * part.size)


def _holes(rim: np.ndarray, at_edge: tuple[bool, bool, bool, bool]) -> np.ndarray:
    """Return what ``rim`` encloses, alone or with one edge of the pad: the first row, the last, columns."""
    filled = ndimage.binary_fill_holes(rim)
    for edge, is_touched in enumerate(at_edge):
        if is_touched:
            axis, end = divmod(edge, 2)
            closed = np.insert(rim, end * rim.shape[axis], True, axis)
            filled |= np.delete(ndimage.binary_fill_holes(closed), end * rim.shape[axis], axis)
    return filled & ~rim


def _hull(mask: np.ndarray) -> np.ndarray:
    """Return the taxels whose centres are in the hull of the centres of ``mask``."""
    row, col = np.nonzero(mask)
    along = np.array((col, row)).T @ HULL_AXES
    row, col = np.indices(mask.shape).reshape(2, -1)
    every = np.array((col, row)).T @ HULL_AXES
    within: np.ndarray = ((every >= along.min(0) - HULL_ROUNDING) & (every <= along.max(0) + HULL_ROUNDING)).all(1)
    return within.reshape(mask.shape)
