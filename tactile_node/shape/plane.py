"""A plane of two features parted by a curve (section 7), and the fitting of such a curve.

The curve is a polynomial on doubly logarithmic axes, u = ln(1 + horizontal), v = ln(0.01 + vertical):
the features scale with powers of the pattern's size. Beyond the fitted range it goes on straight.
How sure a point's side is follows from its height above the curve by a logistic function whose
steepness may change along the curve.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

DEGREE = 4


@dataclass(frozen=True)
class Plane:
    """One curve and the classes above and below it; features by name as in `tactile features`."""

    horizontal: tuple[str, str]      #: kind ('value', 'min', 'max' or 'dif') and feature name
    vertical: tuple[str, str]
    curve: tuple[float, ...]         #: polynomial coefficients in u, lowest power first
    steepness: tuple[float, float]   #: logarithm of the logistic's slope: first + second · u
    fitted: tuple[float, float]      #: range of u that training patterns covered

    def height(self, horizontal: np.ndarray, vertical: np.ndarray) -> np.ndarray:
        """Logit of being above the curve; its sign is the side."""
        u, v = axes(horizontal, vertical)
        inner = np.clip(u, *self.fitted)
        slope = np.polynomial.Polynomial(self.curve).deriv()(inner)
        curve = np.polynomial.Polynomial(self.curve)(inner) + slope * (u - inner)
        return (v - curve) * np.exp(self.steepness[0] + self.steepness[1] * inner)

    def above(self, horizontal: np.ndarray, vertical: np.ndarray) -> np.ndarray:
        """Probability of being of the class above the curve."""
        return expit(self.height(horizontal, vertical))

    def curve_at(self, horizontal: np.ndarray) -> np.ndarray:
        """The curve itself, in the vertical feature's own unit, for drawing it."""
        u, _ = axes(horizontal, 0.0)
        inner = np.clip(u, *self.fitted)
        polynomial = np.polynomial.Polynomial(self.curve)
        return np.exp(polynomial(inner) + polynomial.deriv()(inner) * (u - inner)) - 0.01


def axes(horizontal, vertical) -> tuple[np.ndarray, np.ndarray]:
    """Return the doubly logarithmic axes (u, v)."""
    return np.log(1 + np.asarray(horizontal, float)), np.log(0.01 + np.asarray(vertical, float))


def fit_plane(horizontal_name: tuple[str, str], vertical_name: tuple[str, str], horizontal: np.ndarray,
              vertical: np.ndarray, is_above: np.ndarray) -> Plane:
    """Fit a curve by maximum likelihood; ``is_above``: bool, which points belong above it."""
    u, v = axes(horizontal, vertical)
    sign = np.where(is_above, 1.0, -1.0)
    centre, powers = u.mean(), np.vander(u - u.mean(), DEGREE + 1, increasing=True)

    def loss(parameters):
        """Mean log-loss and its gradient; parameters: curve about ``centre``, then steepness."""
        slope = np.exp(parameters[-2] + parameters[-1] * (u - centre))
        logit = sign * (v - powers @ parameters[:-2]) * slope
        pull = -expit(-logit)
        steepness = [pull @ logit, (pull * logit) @ (u - centre)]
        gradient = np.concatenate((-(pull * sign * slope) @ powers, steepness))
        return np.logaddexp(0, -logit).mean(), gradient / len(u)

    middle = (v[is_above].mean() + v[~is_above].mean()) / 2
    found = minimize(loss, np.array([middle, *[0.0] * DEGREE, 1.0, 0.0]), jac=True, method='BFGS').x
    curve = np.polynomial.Polynomial(found[:-2])(np.polynomial.Polynomial([-centre, 1.0]))
    return Plane(horizontal_name, vertical_name, tuple(map(float, curve.coef)),
                 (float(found[-2] - found[-1] * centre), float(found[-1])), (float(u.min()), float(u.max())))
