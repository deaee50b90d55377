"""Rasterise plane figures by computing the covered fraction of each square cell."""

import numpy as np
from numpy.typing import ArrayLike

from tactile_node.pose.outlines import Window, coverages

CELLS = 96  #: Number of cells along the longer side of the figure.


def as_raster(figure: ArrayLike, cells: int = CELLS) -> np.ndarray:
    """Return the covered fraction of each square cell in the box of a figure, float (rows, cols).

    The array ``figure`` contains the corners of one polygon without crossings, (n, 2), x and y. The array can also be a
    raster, (rows, cols) with more than two columns: bool, or the covered fraction of each cell. Raises ValueError if
    the figure has no area.

    >>> as_raster(np.array([[0, 0], [2, 0], [2, 1], [0, 1]]), cells=4)
    array([[1., 1., 1., 1.],
           [1., 1., 1., 1.]])
    """
    given = np.asarray(figure, float)
    if given.ndim != 2 or not np.isfinite(given).all():
        raise ValueError(f'a figure is an outline (n, 2) or a raster (rows, cols) of finite numbers, not {given.shape}')
    return _of_outline(given, cells) if given.shape[1] == 2 else _of_mask(given, cells)


def coarser(raster: np.ndarray, factor: int) -> np.ndarray:
    """Return the means over blocks of ``factor`` x ``factor`` cells. Cells beyond the raster count as empty."""
    rows, cols = (-(-size // factor) for size in raster.shape)
    wide = np.zeros((rows * factor, cols * factor))
    wide[:raster.shape[0], :raster.shape[1]] = raster
    means: np.ndarray = wide.reshape(rows, factor, cols, factor).mean((1, 3))
    return means


def coverage(corners: np.ndarray, motions: np.ndarray, window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Return the covered fraction of each taxel in ``window``, and its derivatives with respect to the parameters.

    The results have the shapes (rows, cols) and (p, rows, cols).

    The ``corners``, (n, 2), are ordered in the direction from x to y. The ``motions``, (p, n, 2), are d corners / d
    parameter.
    """
    once = np.ones((1, 1))
    covered, changes = coverages(corners[np.newaxis], motions[:, np.newaxis], window, once, once[0])
    return covered[0], changes


def _of_outline(corners: np.ndarray, cells: int) -> np.ndarray:
    """Return the exact covered fractions, computed from the edges of the polygon."""
    low, extent = corners.min(0), np.ptp(corners, axis=0)
    following = np.roll(corners, -1, axis=0)
    twice_area = (corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]).sum()
    if len(corners) < 3 or not abs(twice_area) > 0:
        raise ValueError('the outline encloses no area')
    scaled = (corners - low) * (cells / extent.max()) - 0.5
    cols, rows = np.maximum(np.ceil(extent * (cells / extent.max()) - 1e-9), 1).astype(int)
    in_sense = scaled if twice_area > 0 else scaled[::-1]
    covered, _ = coverage(in_sense, np.zeros((0, len(corners), 2)), Window(0, 0, int(rows), int(cols)))
    covered_part: np.ndarray = np.clip(covered, 0, 1)
    return covered_part


def _of_mask(mask: np.ndarray, cells: int) -> np.ndarray:
    rows, cols = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    if not len(rows):
        raise ValueError('the raster has no covered cell')
    box = mask[rows[0]:rows[-1] + 1, cols[0]:cols[-1] + 1]
    width = max(box.shape) / cells
    covered: np.ndarray = _shares(box.shape[0], width) @ box @ _shares(box.shape[1], width).T
    return covered


def _shares(size: int, width: float) -> np.ndarray:
    """Return how much of each new cell each old cell covers.

    There are ``size`` old cells, and a new cell is ``width`` old cells wide.
    """
    low = width * np.arange(np.ceil(size / width - 1e-9))[:, None]
    old = np.arange(size)
    overlap = np.minimum(low + width, old + 1) - np.maximum(low, old)
    shares: np.ndarray = np.clip(overlap, 0, None) / width
    return shares
