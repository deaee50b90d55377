"""Large contacts in larger taxels: means over square blocks, so that the cost of a fit has a bound."""

from typing import NamedTuple

import numpy as np

WIDEST = 32   #: blocks across a contact at most [taxels of a fit]
AROUND = 3    #: blocks around the contact
VISIBLE = 0.5  #: of a block's taxels: with fewer valid ones it has no value


class Blocks(NamedTuple):
    """A frame and its contact in blocks."""

    values: np.ndarray  #: float, (rows, cols), NaN where too little of a block is seen
    mask: np.ndarray    #: bool
    x: float            #: column of the middle of block (0, 0) [taxels]
    y: float            #: row of it


def size_of(mask: np.ndarray) -> int:
    """Return the side of the blocks that a fit of the contact ``mask``, bool (rows, cols), takes: 1 for most.

    >>> size_of(np.ones((8, 8), bool)), size_of(np.ones((64, 10), bool))
    (1, 2)
    """
    extents = [np.ptp(np.flatnonzero(mask.any(axis))) + 1 for axis in (0, 1)]
    return int(-(-max(extents) // WIDEST))


def in_blocks(values: np.ndarray, mask: np.ndarray, size: int) -> Blocks:
    """Return what surrounds the contact as means of ``size`` x ``size`` taxels; those that the pad's edge cuts are NaN.
    """
    corner, counts = [], []
    for length, axis in zip(mask.shape, (1, 0)):
        used = np.flatnonzero(mask.any(axis))
        first = max(int(used[0]) - AROUND * size, 0)
        last = min(int(used[-1]) + 1 + AROUND * size, length)
        corner.append(first)
        counts.append(-(-(last - first) // size))
    (row, col), (rows, cols) = corner, counts
    window = np.full((rows * size, cols * size), np.nan)
    taxels = np.zeros(window.shape, bool)
    inside = slice(row, row + rows * size), slice(col, col + cols * size)
    part = values[inside]
    window[:part.shape[0], :part.shape[1]] = part
    taxels[:part.shape[0], :part.shape[1]] = mask[inside]
    valid = np.isfinite(window)
    shape, axes = (rows, size, cols, size), (1, 3)
    seen = valid.reshape(shape).sum(axes)
    whole = np.zeros((rows, cols), bool)
    whole[:part.shape[0] // size, :part.shape[1] // size] = True
    means = np.where(valid, window, 0).reshape(shape).sum(axes) / np.maximum(seen, 1)
    means[~whole | (seen < VISIBLE * size ** 2)] = np.nan
    half = (size - 1) / 2
    return Blocks(means, taxels.reshape(shape).mean(axes) >= 0.5, x=col + half, y=row + half)
