"""What a skin shows of a contact: taxel values as a function of outline, pressure and depth.

A pressure skin shows the pressure under a punch or a dome, or a more even one (`profiles`), times (level + tilt_x X +
tilt_y Y), spread by the layer over the taxels (`layer_kernel`). An on/off skin shows 1 where a taxel's centre is
inside.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from tactile_node.pose.outlines import Outline, Window, coverages, moving_depth
from tactile_node.pose.profiles import PUNCH, Profile
from tactile_node.taxel_frame import read_only

KERNEL_REACH = 6                 #: reach of the kernel [pitches]
KERNEL_DEPTHS = 0.08, 2.2        #: for which it is known [pitches]
DEPTH_NODES = 40                #: in equal ratios between them
TAXEL_POINTS = 6                #: points of a taxel, along each axis, that the stress is averaged over
KERNEL_TERMS = 2
LOG_DEPTHS = float(np.log(KERNEL_DEPTHS[0])), float(np.log(KERNEL_DEPTHS[1]))


def taps_at(log_depth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the kernel at a depth, by its natural logarithm [pitches], within the limits of KERNEL_DEPTHS.

    It is the sum of sign * taps along rows * taps along columns, by distance. Signs, (KERNEL_TERMS, 1); taps,
    (KERNEL_TERMS, KERNEL_REACH + 2), 0 beyond KERNEL_REACH; their derivatives by the logarithm.
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
    """Signs of the terms, and taps, (DEPTH_NODES, KERNEL_TERMS, KERNEL_REACH + 2)."""
    found = [_terms(kernel(float(depth))) for depth in np.geomspace(*KERNEL_DEPTHS, DEPTH_NODES)]
    return read_only(found[0][0][:, np.newaxis]), read_only(np.array([taps for _, taps in found]))


def kernel(depth: float) -> np.ndarray:
    """Return the mean stress over taxels up to KERNEL_REACH away, along either axis, under a pressure of 1 on one."""
    inner = (np.arange(TAXEL_POINTS) + 0.5) / TAXEL_POINTS - 0.5
    away = (np.arange(-KERNEL_REACH, KERNEL_REACH + 1)[:, np.newaxis] + inner).reshape(-1)
    corner = _newmark(np.concatenate((away - 0.5, away + 0.5))[:, np.newaxis],
                      np.concatenate((away - 0.5, away + 0.5)), depth)
    count = len(away)
    points = corner[count:, count:] - corner[:count, count:] - corner[count:, :count] + corner[:count, :count]
    side = 2 * KERNEL_REACH + 1
    return points.reshape(side, TAXEL_POINTS, side, TAXEL_POINTS).mean((1, 3))


def _newmark(y: np.ndarray, x: np.ndarray, z: float) -> np.ndarray:
    """Stress under the corner of a rectangle x, y; odd in both. Training and benchmarks have their own."""
    slant = np.sqrt(x * x + y * y + z * z)
    parts = x * y * z / slant * (1 / (x * x + z * z) + 1 / (y * y + z * z))
    return (np.arctan(x * y / (z * slant)) + parts) / (2 * np.pi)


def _terms(whole: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The products that add up to a symmetric kernel: signs, and taps by distance, (KERNEL_TERMS, KERNEL_REACH + 2)."""
    values, vectors = np.linalg.eigh(whole)
    largest = np.argsort(-np.abs(values))[:KERNEL_TERMS]
    taps = (vectors[:, largest] * np.sqrt(np.abs(values[largest]))).T
    taps *= np.sign(taps[:, KERNEL_REACH, np.newaxis])
    return np.sign(values[largest]), np.pad(taps[:, KERNEL_REACH:], ((0, 0), (0, 1)))


LIKELY_PEAKS = 0.0, 1.03    #: peaks of an even pressure and of a flat punch's, as fits find it
PEAK_NEAR = 0.4      #: a first fit is as near to one of them
PEAK_SHOWN = 0.25    #: to this standard deviation or less
PEAK_KNOWN = 0.08    #: standard deviation about it


class Prediction(NamedTuple):
    """Taxel values by a model."""

    values: np.ndarray    #: (rows * cols,)
    jacobian: np.ndarray  #: (parameters, rows * cols)
    rim: np.ndarray       #: (rows * cols,), how much its value changes with the place of the contact [1 / pitch]


class Model:
    """On/off values: a logistic step across the outline, for where a taxel's centre is inside.

    Parameters are the outline's, then a model's own extras, of which this one has none.
    """

    EDGE = 0.1  #: width of the step [pitches]
    expected = np.empty(0)   #: values of the extras, beforehand
    precision = np.empty(0)  #: 1 / variance of that

    def __init__(self, outline: Outline, window: Window):
        self.outline, self.window = outline, window
        rows, cols = np.indices((window.rows, window.cols)).reshape(2, -1)
        self._places = np.stack((cols + window.col, rows + window.row)).astype(float)

    def on(self, window: Window) -> 'Model':
        """Return the same model of another ``window``."""
        return Model(self.outline, window)

    def predict(self, parameters: np.ndarray) -> Prediction:
        """Return what the taxels of the window show."""
        corners, motions = self.outline.moving(parameters, np.ones((1, len(self.outline.dimensions))))
        depth, change = moving_depth(corners[0], motions[:, 0], self._places)
        inside = expit(depth / self.EDGE)
        rim = inside * (1 - inside)
        return Prediction(inside, change * (rim / self.EDGE), rim)

    def starts(self, guess: np.ndarray) -> list[np.ndarray]:
        """Return where a fit may start, the likeliest first, by a guess of the outline's parameters from moments."""
        return [guess]

    def bound(self, extras: np.ndarray) -> None:
        """Keep ``extras`` within what the model knows, in place."""


class PressureModel(Model):
    """Values in units of a typical pressure, so that ``level`` is about 1.

    ``peak``: 0 for a uniform pressure, 1 for the profile's. ``log_depth``: of the taxels below
    the skin's surface [logarithm of pitches].
    """

    TILT_SPREAD = 0.06    #: standard deviation expected of the tilt [relative rise a pitch]
    PEAK_SPREAD = 0.7
    PEAK_OF_DOME = 1.0, 0.35  #: expected, and its deviation: an even pressure is none of a dome's
    DEPTH_SPREAD = 0.6    #: and of the logarithm of the depth
    EXTRAS = 5
    PEAK = -2             #: its place among the parameters
    expected = read_only(np.array((1.0, 0.0, 0.0, 0.7, np.log(0.6))))
    EVEN, FULL = (1.0, 0.0, 0.0, 0.0, np.log(0.4)), (1.0, 0.0, 0.0, 1.0, np.log(0.6))  #: extras to start with
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
        """With the profile's pressure and, of a punch, with an even one: of few taxels both fit nearly as well.

        Rigid objects press as punches and domes do.
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
        rim = np.sqrt(jacobian[0]**2 + jacobian[1]**2)  # the change by a pitch of displacement
        return Prediction(values, jacobian, rim)

    def _kernels(self, log_depth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Along rows (with the sign) and across them, and by the depth's logarithm: (KERNEL_TERMS, n, n) each."""
        signs, taps, by_log_depth = taps_at(log_depth)
        along, deeper_along = ((tap * signs).take(self._row_distance, 1) for tap in (taps, by_log_depth))
        across, deeper_across = (tap.take(self._col_distance, 1) for tap in (taps, by_log_depth))
        return along, across, deeper_along, deeper_across

    def likely_peak(self, parameters: np.ndarray, deviation: float) -> tuple[float, float] | None:
        """Return what ``peak`` is expected to be and 1 / variance of that, by a first fit and its ``deviation``.

        Indenters are of few kinds: what looks like a flat punch is one, and what looks even is even. None: it looks
        like neither.
        """
        if self.profile is not PUNCH:
            return None
        nearest = min(LIKELY_PEAKS, key=lambda peak: abs(peak - parameters[self.PEAK]))
        if deviation > PEAK_SHOWN or abs(nearest - parameters[self.PEAK]) > PEAK_NEAR:
            return None
        return nearest, PEAK_KNOWN ** -2

    def bound(self, extras: np.ndarray) -> None:
        """Keep the depth within what the kernel is known for."""
        extras[-1] = min(max(extras[-1], LOG_DEPTHS[0]), LOG_DEPTHS[1])


def _distances(count: int) -> np.ndarray:
    place = np.arange(count)
    return np.minimum(np.abs(place[:, np.newaxis] - place), KERNEL_REACH + 1)
