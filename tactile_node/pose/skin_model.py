"""Models of the skin that predict taxel values from outline, pressure and depth.

The model of a pressure skin assumes that an object presses like a punch or a dome (`profiles`), or more evenly. The
pressure is multiplied by (level + tilt_x X + tilt_y Y), and the layer spreads the pressure over the taxels (`kernel`).
In the model of an on/off skin, a taxel reads 1 if its centre is inside the outline.
"""

from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from tactile_node.pose.outlines import Outline, Window, coverages, moving_depth
from tactile_node.pose.profiles import PUNCH, Profile
from tactile_node.taxel_frame import read_only

KERNEL_REACH = 6           #: Reach of the kernel [pitches].
KERNEL_DEPTHS = 0.08, 2.2  #: Smallest and largest depth for which the kernel is tabulated [pitches].
DEPTH_NODES = 40           #: Number of tabulated depths, which are spaced geometrically.
TAXEL_POINTS = 6           #: Number of points along each axis of a taxel over which the stress is averaged.
KERNEL_TERMS = 2
LOG_DEPTHS = float(np.log(KERNEL_DEPTHS[0])), float(np.log(KERNEL_DEPTHS[1]))


def taps_at(log_depth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the kernel at a depth.

    The kernel is a sum of terms. Each term is the product of a sign, the filter coefficients (taps) along the rows, and
    the same coefficients along the columns. The coefficients are indexed by distance.

    Parameters
    ----------
    log_depth : float
        Natural logarithm of the depth in pitches, which the function limits to KERNEL_DEPTHS.

    Returns
    -------
    signs : np.ndarray
        (KERNEL_TERMS, 1).
    taps : np.ndarray
        Taps by distance, (KERNEL_TERMS, KERNEL_REACH + 2), with 0 beyond KERNEL_REACH.
    derivatives : np.ndarray
        Derivatives of the taps with respect to ``log_depth``, of the same shape.
    """
    signs, table = _table()
    low, high = LOG_DEPTHS
    step = (high - low) / (DEPTH_NODES - 1)
    place = min(max((log_depth - low) / step, 0.0), DEPTH_NODES - 1.001)
    node = int(place)
    share, change = place - node, table[node + 1] - table[node]
    return signs, table[node] + share * change, change / step


@cache
def _table() -> tuple[np.ndarray, np.ndarray]:
    """Return the signs of the terms, and the taps by depth, (DEPTH_NODES, KERNEL_TERMS, KERNEL_REACH + 2)."""
    found = [_terms(kernel(float(depth))) for depth in np.geomspace(*KERNEL_DEPTHS, DEPTH_NODES)]
    return read_only(found[0][0][:, np.newaxis]), read_only(np.array([taps for _, taps in found]))


def kernel(depth: float) -> np.ndarray:
    """Return the mean stress on each taxel around a taxel loaded with a pressure of 1.

    The surrounding taxels are up to KERNEL_REACH away along either axis. ``depth`` is in pitches.
    """
    inner = (np.arange(TAXEL_POINTS) + 0.5) / TAXEL_POINTS - 0.5
    away = (np.arange(-KERNEL_REACH, KERNEL_REACH + 1)[:, np.newaxis] + inner).reshape(-1)
    corner = _newmark(np.concatenate((away - 0.5, away + 0.5))[:, np.newaxis],
                      np.concatenate((away - 0.5, away + 0.5)), depth)
    count = len(away)
    points = corner[count:, count:] - corner[:count, count:] - corner[count:, :count] + corner[:count, :count]
    side = 2 * KERNEL_REACH + 1
    return points.reshape(side, TAXEL_POINTS, side, TAXEL_POINTS).mean((1, 3))


def _newmark(y: np.ndarray, x: np.ndarray, z: float) -> np.ndarray:
    """Return the stress under the corner of a rectangle x, y (Newmark).

    The stress is an odd function of x and of y. Training and benchmarks use a separate implementation, against which
    this function can be checked.
    """
    slant = np.sqrt(x * x + y * y + z * z)
    parts = x * y * z / slant * (1 / (x * x + z * z) + 1 / (y * y + z * z))
    return (np.arctan(x * y / (z * slant)) + parts) / (2 * np.pi)


def _terms(whole: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Decompose a symmetric kernel into a sum of products.

    The function returns the sign of each product, and the taps by distance, (KERNEL_TERMS, KERNEL_REACH + 2).
    """
    values, vectors = np.linalg.eigh(whole)
    largest = np.argsort(-np.abs(values))[:KERNEL_TERMS]
    taps = (vectors[:, largest] * np.sqrt(np.abs(values[largest]))).T
    taps *= np.sign(taps[:, KERNEL_REACH, np.newaxis])
    return np.sign(values[largest]), np.pad(taps[:, KERNEL_REACH:], ((0, 0), (0, 1)))


LIKELY_PEAKS = 0.0, 1.03  #: Peak that a fit finds for an even pressure, and for a flat punch.
PEAK_NEAR = 0.4           #: Largest difference between the peak of a first fit and a likely peak.
PEAK_SHOWN = 0.25         #: Largest standard deviation of the peak for which a first fit is trusted.
PEAK_KNOWN = 0.08         #: Standard deviation of the peak among objects of one kind.


class Prediction(NamedTuple):
    """The taxel values that a model predicts."""

    parameters: np.ndarray  #: parameters for which the values are computed
    values: np.ndarray    #: (rows * cols,)
    jacobian: np.ndarray  #: (parameters, rows * cols)
    rim: np.ndarray       #: (rows * cols,), sensitivity of each value to the position of the outline

    def values_near(self, parameters: np.ndarray) -> np.ndarray:
        """Return the values at nearby ``parameters``, with the model treated as linear."""
        found: np.ndarray = self.values + (parameters - self.parameters) @ self.jacobian
        return found


class Model:
    """Model of on/off values, with a logistic step across the outline.

    The parameters are those of the outline, followed by extra parameters of the model, called extras. The on/off model
    has no extras.
    """

    EDGE = 0.1               #: width of the step [pitches]
    expected = np.empty(0)   #: expected values of the extras
    precision = np.empty(0)  #: 1 / variance of the expected values

    def __init__(self, outline: Outline, window: Window):
        self.outline, self.window = outline, window

    @cached_property
    def _places(self) -> np.ndarray:
        """Positions of the taxels, (2, taxels)."""
        rows, cols = np.indices((self.window.rows, self.window.cols)).reshape(2, -1)
        return np.stack((cols + self.window.col, rows + self.window.row)).astype(float)

    def on(self, window: Window) -> 'Model':
        """Return the same model for another ``window``."""
        return Model(self.outline, window)

    def predict(self, parameters: np.ndarray) -> Prediction:
        """Return the values of the taxels in the window."""
        corners, motions = self.outline.moving(parameters, np.ones((1, len(self.outline.dimensions))))
        depth, change = moving_depth(corners[0], motions[:, 0], self._places)
        inside = expit(depth / self.EDGE)
        rim = inside * (1 - inside)
        return Prediction(parameters, inside, change * (rim / self.EDGE), rim)

    def starts(self, guess: np.ndarray) -> list[np.ndarray]:
        """Return the starting points of a fit, the likeliest first, from a ``guess`` of the outline's parameters."""
        return [guess]

    def bound(self, extras: np.ndarray) -> None:
        """Limit ``extras``, in place, to the range of the model."""


class PressureModel(Model):
    """Model of pressures in units of a typical pressure, which makes ``level`` about 1.

    The extras of the model are ``level``, ``tilt_x``, ``tilt_y``, ``peak`` and ``log_depth``. ``peak`` is 0 for a
    uniform pressure and 1 for the pressure of the profile. ``log_depth`` is the logarithm of the depth of the taxels
    below the skin's surface [pitches].
    """

    TILT_SPREAD = 0.06        #: standard deviation of the tilt [relative rise per pitch]
    PEAK_SPREAD = 0.7         #: standard deviation of the peak of a punch

    #: expected peak of a dome and its standard deviation, because the pressure of a dome is never even
    PEAK_OF_DOME = 1.0, 0.35
    DEPTH_SPREAD = 0.6        #: standard deviation of the logarithm of the depth
    EXTRAS = 5
    PEAK = -2  #: index of the peak among the parameters
    expected = read_only(np.array((1.0, 0.0, 0.0, 0.7, np.log(0.6))))
    EVEN = (1.0, 0.0, 0.0, 0.0, np.log(0.4))  #: extras of a starting point with an even pressure
    FULL = (1.0, 0.0, 0.0, 1.0, np.log(0.6))  #: extras of a starting point with the pressure of the profile
    precision = read_only(np.array((1.0, TILT_SPREAD, TILT_SPREAD, PEAK_SPREAD, DEPTH_SPREAD)) ** -2)

    def __init__(self, outline: Outline, window: Window, centre: np.ndarray, profile: Profile = PUNCH):
        super().__init__(outline, window)
        self.profile, self._centre = profile, centre
        if profile is not PUNCH:
            peak, deviation = self.PEAK_OF_DOME
            self.expected, self.precision = self.expected.copy(), self.precision.copy()
            self.expected[self.PEAK], self.precision[self.PEAK] = peak, deviation ** -2
        self._x = window.col + np.arange(window.cols) - centre[0]
        self._y = (window.row + np.arange(window.rows) - centre[1])[:, np.newaxis]
        self._row_distance, self._col_distance = _distances(window.rows), _distances(window.cols)

    def on(self, window: Window) -> 'PressureModel':
        return PressureModel(self.outline, window, self._centre, self.profile)

    def starts(self, guess: np.ndarray) -> list[np.ndarray]:
        """Return a starting point with the pressure of the profile and, for a punch, another with an even pressure.

        The pressure of the profile comes first, because rigid objects press like punches and domes. With few taxels,
        both pressures fit almost equally well.
        """
        sized, count = guess.copy(), len(self.outline.dimensions)
        sized[-count:] *= self.profile.length_ratio[-count:]
        starts = [np.concatenate((sized, self.FULL))]
        if self.profile is PUNCH:
            starts.append(np.concatenate((guess, self.EVEN)))
        return starts

    def predict(self, parameters: np.ndarray) -> Prediction:
        geometry, (level, tilt_x, tilt_y, peak, log_depth) = parameters[:-self.EXTRAS], parameters[-self.EXTRAS:]
        weights = self.profile.weights
        of_change = weights[0] + peak * weights[1]
        sizes = self.profile.sizes[:, -len(self.outline.dimensions):]
        covered, change = coverages(*self.outline.moving(geometry, sizes), self.window, weights, of_change)
        pressed, force = covered[0] + peak * covered[1], level + tilt_x * self._x + tilt_y * self._y
        count = len(parameters)
        sharp = np.empty((count, *pressed.shape))
        np.multiply(change, force, out=sharp[:-self.EXTRAS])
        sharp[-5] = pressed
        np.multiply(pressed, self._x, out=sharp[-4])
        np.multiply(pressed, self._y, out=sharp[-3])
        np.multiply(covered[1], force, out=sharp[-2])
        np.multiply(pressed, force, out=sharp[-1])
        along, across, deeper_along, deeper_across = self._kernels(log_depth)
        by_cols = sharp @ across[:, np.newaxis]
        jacobian = (along[:, np.newaxis] @ by_cols).sum(0)
        values = jacobian[-1].reshape(-1).copy()
        jacobian[-1] = (deeper_along @ by_cols[:, -1] + along @ (sharp[-1] @ deeper_across)).sum(0)
        jacobian = jacobian.reshape(count, -1)
        rim = np.sqrt(jacobian[0]**2 + jacobian[1]**2)  # change per pitch of displacement
        return Prediction(parameters, values, jacobian, rim)

    def _kernels(self, log_depth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return the kernels along rows (with the sign) and across rows, and the derivatives of both.

        Each array has the shape (KERNEL_TERMS, n, n). The derivatives are taken with respect to the logarithm of the
        depth.
        """
        signs, taps, by_log_depth = taps_at(log_depth)
        along, deeper_along = ((tap * signs).take(self._row_distance, 1) for tap in (taps, by_log_depth))
        across, deeper_across = (tap.take(self._col_distance, 1) for tap in (taps, by_log_depth))
        return along, across, deeper_along, deeper_across

    def likely_peak(self, parameters: np.ndarray, deviation: float) -> tuple[float, float] | None:
        """Return the expected ``peak`` and its 1 / variance after a first fit, or None.

        Real objects fall into a few kinds. If a fit looks like a flat punch, the function assumes a flat punch. If the
        pressure looks even, the function assumes an even pressure. If the fit looks like neither, the function returns
        None.

        Parameters
        ----------
        parameters : np.ndarray
            Parameters of the first fit.
        deviation : float
            Standard deviation of the peak in the first fit.
        """
        if self.profile is not PUNCH:
            return None
        nearest = min(LIKELY_PEAKS, key=lambda peak: abs(peak - parameters[self.PEAK]))
        if deviation > PEAK_SHOWN or abs(nearest - parameters[self.PEAK]) > PEAK_NEAR:
            return None
        return nearest, PEAK_KNOWN ** -2

    def bound(self, extras: np.ndarray) -> None:
        """Limit the depth, in place, to the range for which the kernel is tabulated."""
        extras[-1] = min(max(extras[-1], LOG_DEPTHS[0]), LOG_DEPTHS[1])


def _distances(count: int) -> np.ndarray:
    place = np.arange(count)
    return np.minimum(np.abs(place[:, np.newaxis] - place), KERNEL_REACH + 1)
