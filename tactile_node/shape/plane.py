"""A plane of two features parted by a curve (section 7), and the fitting of such a curve.

The curve is a chain of straight lines on doubly logarithmic axes, u = ln(1 + horizontal),
v = ln(0.01 + vertical): the features scale with powers of the pattern's size. Beyond its ends it
continues straight.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

KNOTS = 9
LEVELS = 41   #: heights tried at each knot, first over the whole plane, then about what was found
STIFF = 5.0   #: patterns a curve must gain for a kink that misses the neighbours' middle by 1 in v


@dataclass(frozen=True)
class Plane:
    """One curve and the classes above and below it; features by name as in `tactile features`."""

    horizontal: tuple[str, str]      #: kind ('value', 'min', 'max' or 'dif') and feature name
    vertical: tuple[str, str]
    knots: tuple[float, ...]         #: u of the curve's corners, rising
    levels: tuple[float, ...]        #: v of the curve's corners

    def height(self, horizontal: ArrayLike, vertical: ArrayLike) -> np.ndarray:
        """Return how far points lie above the curve, along v; the sign is the side."""
        u, v = axes(horizontal, vertical)
        above: np.ndarray = v - self._curve(u)
        return above

    def curve_at(self, horizontal: np.ndarray) -> np.ndarray:
        """Return the curve itself, in the vertical feature's own unit, for drawing it."""
        curve: np.ndarray = np.exp(self._curve(axes(horizontal, 0.0)[0])) - 0.01
        return curve

    def _curve(self, u: np.ndarray) -> np.ndarray:
        inner = np.interp(u, self.knots, self.levels)
        before, after = (np.diff(self.levels) / np.diff(self.knots))[[0, -1]]
        curve: np.ndarray = (inner + before * np.minimum(u - self.knots[0], 0)
                             + after * np.maximum(u - self.knots[-1], 0))
        return curve


def axes(horizontal: ArrayLike, vertical: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return the doubly logarithmic axes (u, v)."""
    return np.log(1 + np.asarray(horizontal, float)), np.log(0.01 + np.asarray(vertical, float))


def fit_curve(u: np.ndarray, v: np.ndarray, gain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return knots and levels of the chain of lines with the greatest sum of ``gain`` above it.

    ``gain``, shape (n,): what is won by having a point above the curve instead of below, negative where it
    is lost. Found by dynamic programming over the heights at the knots: nothing better exists on its grid,
    wherever one starts; a second, finer grid lies about the first one's answer.
    """
    some = gain != 0
    u, v, gain = u[some], v[some], gain[some]
    knots = np.linspace(u.min(), u.max(), KNOTS)
    low, high = np.quantile(v, (0.001, 0.999))
    grid = np.tile(np.linspace(low, high, LEVELS), (KNOTS, 1))
    coarse = _best_chain(u, v, gain, knots=knots, grid=grid)
    step = grid[0, 1] - grid[0, 0]
    finer = coarse[:, None] + np.linspace(-1.5, 1.5, LEVELS) * step
    return knots, _best_chain(u, v, gain, knots=knots, grid=finer)


def _best_chain(u: np.ndarray, v: np.ndarray, gain: np.ndarray, knots: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Best heights at ``knots``, one of each row of ``grid``, shape (knots, levels)."""
    segment = np.clip(np.searchsorted(knots, u, 'right') - 1, 0, len(knots) - 2)
    won = []
    for k, (left, right) in enumerate(zip(knots, knots[1:])):
        inside = segment == k
        share = (u[inside] - left) / (right - left)
        won.append(_gain_of_lines(share, v[inside], gain[inside], left=grid[k], right=grid[k + 1]))
    best, choices = won[0], []  # best[a, b]: of all chains that end in the heights a, b
    for k in range(1, len(won)):
        kink = np.abs(grid[k - 1][:, None, None] - 2 * grid[k][:, None] + grid[k + 1])
        total = best[:, :, None] - STIFF * kink
        choices.append(total.argmax(0))
        best = total.max(0) + won[k]
    path = [int(place) for place in np.unravel_index(best.argmax(), best.shape)]
    for choice in reversed(choices):
        path.insert(0, int(choice[path[0], path[1]]))
    return grid[np.arange(len(knots)), path]


def _gain_of_lines(share: np.ndarray, v: np.ndarray, gain: np.ndarray, left: np.ndarray,
                   right: np.ndarray) -> np.ndarray:
    """Sum of gains above each line from a height ``left`` to a height ``right``, shape (left, right)."""
    rising = right * share[:, None]
    return np.array([gain @ (v[:, None] > rising + (height * (1 - share))[:, None]) for height in left])
