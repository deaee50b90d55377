"""How much of each taxel's square a polygon covers, exactly, and how that changes as the polygon moves."""

from typing import NamedTuple

import numpy as np

FAR = -1e6  #: left of everything


class Window(NamedTuple):
    """A block of taxels; taxel (row, col) is the unit square about x = col, y = row."""

    row: int
    col: int
    rows: int
    cols: int

    @property
    def slices(self) -> tuple[slice, slice]:
        return slice(self.row, self.row + self.rows), slice(self.col, self.col + self.cols)


def coverage(corners: np.ndarray, motions: np.ndarray, window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Return the covered fraction of each taxel of ``window``, (rows, cols), and its derivatives, (p, rows, cols).

    ``corners``: (n, 2), in the sense from x to y; ``motions``: (p, n, 2), d corners / d parameter.
    By the divergence theorem: an edge's outward normal N (as long as the edge) and the stretch t0...t1 of it
    within a taxel give d area = ∫ N · motion dt, and area = ∫ N_x (x - left) dt + the length of the taxel's
    right side within the polygon; that length is what all edges to the left have let in.
    """
    start, stop = corners, np.roll(corners, -1, axis=0)
    normal = (stop - start)[:, ::-1] * (1.0, -1.0)
    before, after = _stretches(start, stop, window)
    moved = np.concatenate(((motions * normal).sum(-1), (np.roll(motions, -1, axis=1) * normal).sum(-1)), axis=1)
    normal_x = np.concatenate((normal[:, 0], normal[:, 0]))
    start_stop_x = np.concatenate((start[:, 0], stop[:, 0]))
    rows = np.concatenate(((normal_x * start_stop_x)[None], normal_x[None], moved))
    flux = (rows @ np.concatenate((before, after)).reshape(2 * len(corners), -1)).reshape(
        len(rows), window.rows, window.cols + 1)
    left = window.col - 0.5 + np.arange(window.cols)
    right_side = -flux[1].cumsum(1)[:, 1:]
    return flux[0, :, 1:] - left * flux[1, :, 1:] + right_side, flux[2:, :, 1:]


def _stretches(start: np.ndarray, stop: np.ndarray, window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Return ∫ (1 - t) dt and ∫ t dt of each edge within each taxel, shape (edges, rows, 1 + cols).

    The first column is all that lies left of the window: a contact may be cut off by the pad's edge.
    """
    edge = stop - start
    edge = np.where(np.abs(edge) < 1e-12, 1e-12, edge)
    x_lines = window.col - 1.5 + np.arange(window.cols + 2)
    x_lines[0] = FAR
    y_lines = window.row - 0.5 + np.arange(window.rows + 1)
    x0, x1 = _between((x_lines - start[:, :1]) / edge[:, :1])
    y0, y1 = _between((y_lines - start[:, 1:]) / edge[:, 1:])
    t0 = np.maximum(x0[:, None, :], y0[:, :, None])
    length = np.maximum(np.minimum(x1[:, None, :], y1[:, :, None]) - t0, 0)
    after = length * (t0 + 0.5 * length)
    return length - after, after


def _between(crossings: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where an edge enters and leaves each strip between two neighbouring lines, within 0...1."""
    clipped = np.minimum(np.maximum(crossings, 0), 1)
    return (np.minimum(clipped[:, :-1], clipped[:, 1:]), np.maximum(clipped[:, :-1], clipped[:, 1:]))
