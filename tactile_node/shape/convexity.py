"""Check how much of its convex hull a contact fills.

The five shapes are convex. Hooks, bows and scattered pieces are not convex.
"""

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED, box_of, reached

#: Smallest share of its hull that each of the five shapes fills, after small gaps are closed and rims are filled. The
#: value was chosen on the validation seeds.
LEAST_CONVEXITY = 0.7
PARTIAL_LEVEL = 0.2  #: Taxels with a pressure above this share of the contact's mean belong to the contact.
HULL_ANGLES = np.radians(np.arange(0.0, 180.0, 7.5))  #: Directions in which the hull is measured [rad].
HULL_AXES = np.stack((np.cos(HULL_ANGLES), np.sin(HULL_ANGLES)))  #: Unit vector of each direction, one per column.
HULL_ROUNDING = 0.01  #: Points up to this distance outside the hull count as inside [pitches].


def is_convex(values: np.ndarray, mask: np.ndarray) -> bool:
    """Return True if the contact fills its convex hull as much as the five shapes do.

    Taxels without a value do not count as notches. A hole counts as filled if it is enclosed by a rim, or by a rim and
    one edge of the pad.

    Parameters
    ----------
    values : np.ndarray
        Taxel values of the frame, float (rows, cols), with NaN for a missing value.
    mask : np.ndarray
        Taxels of the contact, bool (rows, cols).

    Examples
    --------
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
    """Return True if ``taxels``, bool (rows, cols), fill LEAST_CONVEXITY of ``hull``.

    ``hull`` is a mask, bool (rows, cols), or a box of rows and columns.
    """
    part = taxels[hull]
    return bool(np.count_nonzero(part) >= LEAST_CONVEXITY * part.size)


def _holes(rim: np.ndarray, at_edge: tuple[bool, bool, bool, bool]) -> np.ndarray:
    """Return the taxels that ``rim`` encloses, alone or together with one edge of the pad.

    ``at_edge`` is True for each edge that counts, in the order first row, last row, first column, last column.
    """
    filled = ndimage.binary_fill_holes(rim)
    for edge, is_touched in enumerate(at_edge):
        if is_touched:
            axis, end = divmod(edge, 2)
            closed = np.insert(rim, end * rim.shape[axis], True, axis)
            filled |= np.delete(ndimage.binary_fill_holes(closed), end * rim.shape[axis], axis)
    return filled & ~rim


def _hull(mask: np.ndarray) -> np.ndarray:
    """Return the taxels whose centres lie in the convex hull of the centres of ``mask``."""
    row, col = np.nonzero(mask)
    along = np.array((col, row)).T @ HULL_AXES
    row, col = np.indices(mask.shape).reshape(2, -1)
    every = np.array((col, row)).T @ HULL_AXES
    within: np.ndarray = ((every >= along.min(0) - HULL_ROUNDING) & (every <= along.max(0) + HULL_ROUNDING)).all(1)
    return within.reshape(mask.shape)
