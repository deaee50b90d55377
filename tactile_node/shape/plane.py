"""A plane of two features parted by a curve (section 7).

The curve is a chain of straight lines on doubly logarithmic axes, u = ln(1 + horizontal),
v = ln(0.01 + vertical): the features scale with powers of the pattern's size. Beyond its ends it
continues straight.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


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
