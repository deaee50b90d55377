"""How a layer spreads pressure: from what presses each taxel's square to the mean stress of its neighbours at a depth.

Boussinesq's normal stress 3 z^3 / (2 pi (r^2 + z^2)^(5/2)) in an elastic half-space, integrated over the square that is
pressed (Newmark 1935) and averaged over the one that feels it. The kernel of each depth is nearly a product of one
along rows and one along columns; the sum of two such products is exact to 0.002.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from tactile_node.read_only import read_only

REACH = 6                 #: of the kernel [pitches]
DEPTHS = 0.08, 2.2        #: for which it is known [pitches]
NODES = 40                #: in equal ratios between them
POINTS = 6                #: of a taxel, along each axis, that the stress is averaged over
TERMS = 2
LOG_DEPTHS = float(np.log(DEPTHS[0])), float(np.log(DEPTHS[1]))


class Taps(NamedTuple):
    """Kernel = sum of sign * taps along rows * taps along columns, by distance."""

    signs: np.ndarray        #: (TERMS, 1)
    taps: np.ndarray         #: (TERMS, REACH + 2), 0 beyond REACH
    by_log_depth: np.ndarray  #: their derivatives


def taps_at(log_depth: float) -> Taps:
    """Return the kernel at a depth, by its natural logarithm [pitches], within the limits of DEPTHS."""
    signs, table = _table()
    low, high = LOG_DEPTHS
    step = (high - low) / (NODES - 1)
    place = min(max((log_depth - low) / step, 0.0), NODES - 1.001)
    node = int(place)
    share, change = place - node, table[node + 1] - table[node]
    return Taps(signs, table[node] + share * change, change / step)


@cache
def _table() -> tuple[np.ndarray, np.ndarray]:
    """Signs of the terms, and taps, (NODES, TERMS, REACH + 2)."""
    found = [_terms(kernel(float(depth))) for depth in np.geomspace(*DEPTHS, NODES)]
    return read_only(found[0][0][:, np.newaxis]), read_only(np.array([taps for _, taps in found]))


def kernel(depth: float) -> np.ndarray:
    """Return the mean stress over taxels up to REACH away under a pressure of 1 on one, (2 REACH + 1, 2 REACH + 1)."""
    inner = (np.arange(POINTS) + 0.5) / POINTS - 0.5
    away = (np.arange(-REACH, REACH + 1)[:, np.newaxis] + inner).reshape(-1)
    corner = _newmark(np.concatenate((away - 0.5, away + 0.5))[:, np.newaxis],
                      np.concatenate((away - 0.5, away + 0.5)), depth)
    count = len(away)
    points = corner[count:, count:] - corner[:count, count:] - corner[count:, :count] + corner[:count, :count]
    side = 2 * REACH + 1
    mean: np.ndarray = points.reshape(side, POINTS, side, POINTS).mean((1, 3))
    return mean


def _newmark(y: np.ndarray, x: np.ndarray, z: float) -> np.ndarray:
    """Stress under the corner of a rectangle x, y; odd in both. Training and benchmarks have their own."""
    slant = np.sqrt(x * x + y * y + z * z)
    parts = x * y * z / slant * (1 / (x * x + z * z) + 1 / (y * y + z * z))
    stress: np.ndarray = (np.arctan(x * y / (z * slant)) + parts) / (2 * np.pi)
    return stress


def _terms(whole: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The products that add up to a symmetric kernel: signs, and taps by distance, (TERMS, REACH + 2)."""
    values, vectors = np.linalg.eigh(whole)
    largest = np.argsort(-np.abs(values))[:TERMS]
    taps = (vectors[:, largest] * np.sqrt(np.abs(values[largest]))).T
    taps *= np.sign(taps[:, REACH, np.newaxis])
    return np.sign(values[largest]), np.pad(taps[:, REACH:], ((0, 0), (0, 1)))
