"""How much of each taxel's square a polygon covers, exactly, and how that changes as the polygon moves."""

from typing import NamedTuple

import numpy as np

FAR = -1e6    #: left of everything
TINY = 1e-12  #: an edge along the lattice is tilted by so much


class Window(NamedTuple):
    """A block of taxels; taxel (row, col) is the unit square about x = col, y = row."""

    row: int
    col: int
    rows: int
    cols: int


def coverages(corners: np.ndarray, motions: np.ndarray, window: Window, weights: np.ndarray,
              of_change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return sums of what k polygons cover of each taxel, each with its weight, and the derivatives of one such sum.

    Shapes (m, rows, cols) and (p, rows, cols). ``corners``: (k, n, 2); ``motions``: (p, k, n, 2); ``weights``: (m, k),
    a row a sum; ``of_change``: (k,), of the sum whose derivatives are wanted.
    By the divergence theorem: an edge's outward normal N (as long as the edge) and the stretch t0...t1 of it
    within a taxel give d area = ∫ N · motion dt, and area = ∫ N_x (x - left) dt + the length of the taxel's
    right side within the polygon; that length is what all edges to the left have let in.
    """
    sums, each = len(weights), corners.shape[1]
    edges = corners.shape[0] * each
    following = np.arange(1, each + 1) % each
    start, stop = corners.reshape(-1, 2), corners[:, following].reshape(-1, 2)
    edge = stop - start
    normal = edge[:, ::-1] * (1.0, -1.0)
    rows = np.empty((2 * sums + len(motions), 2 * edges))
    weight = np.repeat(weights, each, axis=1) * normal[:, 0]
    rows[sums:2 * sums, :edges] = rows[sums:2 * sums, edges:] = weight
    rows[:sums, :edges], rows[:sums, edges:] = weight * start[:, 0], weight * stop[:, 0]
    by_corner = motions * (normal.reshape(corners.shape) * of_change[:, np.newaxis, np.newaxis])
    rows[2 * sums:, :edges] = (by_corner[..., 0] + by_corner[..., 1]).reshape(-1, edges)
    by_corner = motions[:, :, following] * (normal.reshape(corners.shape) * of_change[:, np.newaxis, np.newaxis])
    rows[2 * sums:, edges:] = (by_corner[..., 0] + by_corner[..., 1]).reshape(-1, edges)
    stretches = _stretches(start, edge, window).reshape(2 * edges, -1)
    flux = (rows @ stretches).reshape(len(rows), window.rows, window.cols + 1)
    left = window.col - 0.5 + np.arange(window.cols)
    right_side = -flux[sums:2 * sums].cumsum(2)[..., 1:]
    return flux[:sums, :, 1:] - left * flux[sums:2 * sums, :, 1:] + right_side, flux[2 * sums:, :, 1:]


def _stretches(start: np.ndarray, edge: np.ndarray, window: Window) -> np.ndarray:
    """Return ∫ (1 - t) dt and ∫ t dt of each edge within each taxel, shape (2, edges, rows, 1 + cols).

    The first column is all that lies left of the window: a contact may be cut off by the pad's edge.
    """
    edge = np.where(np.abs(edge) < TINY, TINY, edge)
    lines = np.empty((len(start), window.cols + window.rows + 3))
    x_lines, y_lines = lines[:, :window.cols + 2], lines[:, window.cols + 2:]
    x_lines[:] = np.arange(window.col - 1.5, window.col + window.cols)
    x_lines[:, 0] = FAR
    y_lines[:] = np.arange(window.row - 0.5, window.row + window.rows)
    x_lines -= start[:, :1]
    x_lines /= edge[:, :1]
    y_lines -= start[:, 1:]
    y_lines /= edge[:, 1:]
    np.minimum(np.maximum(lines, 0, out=lines), 1, out=lines)
    enters = np.minimum(lines[:, :-1], lines[:, 1:])  # each strip between two lines
    leaves = np.maximum(lines[:, :-1], lines[:, 1:])
    cols, rows = slice(window.cols + 1), slice(window.cols + 2, None)
    begin = np.maximum(enters[:, None, cols], enters[:, rows, None])
    length = np.minimum(leaves[:, None, cols], leaves[:, rows, None])
    length -= begin
    np.maximum(length, 0, out=length)
    stretches = np.empty((2, *length.shape))
    np.multiply(length, begin + 0.5 * length, out=stretches[1])
    np.subtract(length, stretches[1], out=stretches[0])
    return stretches
