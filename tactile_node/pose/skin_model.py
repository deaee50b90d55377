"""What a skin shows of a contact: taxel values as a function of outline, pressure and blur.

A pressure skin shows (level + tilt_x X + tilt_y Y) times the covered fraction of the taxel, blurred by the
elastomer: a sampled Gaussian with taps proportional to spread^(k²), spread = exp(-1 / 2σ²). An on/off skin
shows 1 where a taxel's centre is inside.
"""

from typing import NamedTuple, Protocol

import numpy as np
from scipy.special import expit

from tactile_node.geometry.coverage import Window, coverage
from tactile_node.geometry.outlines import Outline
from tactile_node.geometry.polygon import moving_depth


class Prediction(NamedTuple):
    """Taxel values by a model."""

    values: np.ndarray    #: (rows * cols,)
    jacobian: np.ndarray  #: (parameters, rows * cols)
    rim: np.ndarray       #: (rows * cols,), how much of the outline a taxel feels


class Model(Protocol):
    """Parameters are the outline's, then the model's own ``extras``."""

    outline: Outline
    start: np.ndarray      #: first values of the extras
    precision: np.ndarray  #: 1 / variance of the extras beforehand, about ``start``

    def predict(self, parameters: np.ndarray) -> Prediction: ...


class PatternModel:
    """On/off values: a logistic step across the outline, for where a taxel's centre is inside."""

    EDGE = 0.1  #: its width [pitches]
    start = precision = np.empty(0)

    def __init__(self, outline: Outline, window: Window):
        self.outline = outline
        rows, cols = np.indices((window.rows, window.cols)).reshape(2, -1)
        self._places = np.stack((cols + window.col, rows + window.row)).astype(float)

    def predict(self, parameters: np.ndarray) -> Prediction:
        depth, change = moving_depth(*self.outline.moving(parameters), self._places)
        inside = expit(depth / self.EDGE)
        rim = inside * (1 - inside)
        return Prediction(inside, change * (rim / self.EDGE), rim)


class PressureModel:
    """Values in units of a typical pressure, so that ``level`` is about 1."""

    TILT_SPREAD = 0.06    #: standard deviation expected of the tilt [relative rise a pitch]
    BLUR_SPREAD = 0.15    #: and of the neighbour's share; 0.135 is a blur of half a pitch
    start = np.array((1.0, 0.0, 0.0, 0.02))
    precision = np.array((1.0, TILT_SPREAD**-2, TILT_SPREAD**-2, BLUR_SPREAD**-2))

    def __init__(self, outline: Outline, window: Window, centre: np.ndarray):
        self.outline, self._window = outline, window
        self._x = window.col + np.arange(window.cols) - centre[0]
        self._y = (window.row + np.arange(window.rows) - centre[1])[:, np.newaxis]
        self._row_distance, self._col_distance = _distances(window.rows), _distances(window.cols)

    def predict(self, parameters: np.ndarray) -> Prediction:
        geometry, (level, tilt_x, tilt_y, spread) = parameters[:-4], parameters[-4:]
        covered, change = coverage(*self.outline.moving(geometry), self._window)
        pressure = level + tilt_x * self._x + tilt_y * self._y
        count = len(parameters)
        sharp = np.empty((count, *covered.shape))
        np.multiply(change, pressure, out=sharp[:-4])
        sharp[-4] = covered
        np.multiply(covered, self._x, out=sharp[-3])
        np.multiply(covered, self._y, out=sharp[-2])
        np.multiply(covered, pressure, out=sharp[-1])
        taps, d_taps = _taps(spread)
        rows, cols, d_rows = taps[self._row_distance], taps[self._col_distance], d_taps[self._row_distance]
        jacobian = sharp @ cols
        contact = d_rows @ jacobian[-1] + rows @ (sharp[-1] @ d_taps[self._col_distance])
        jacobian = rows @ jacobian
        jacobian[-1] = contact
        jacobian = jacobian.reshape(count, -1)
        rim = np.sqrt(jacobian[0]**2 + jacobian[1]**2)  # the change by a pitch of displacement
        return Prediction(parameters[-4:-1] @ jacobian[-4:-1], jacobian, rim)


def _distances(count: int) -> np.ndarray:
    place = np.arange(count)
    apart: np.ndarray = np.minimum(np.abs(place[:, np.newaxis] - place), 3)
    return apart


def _taps(spread: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a blurring kernel at the distances 0, 1, 2, more and its derivative by ``spread``."""
    taps = np.array((1.0, spread, spread**4, 0.0))
    d_taps = np.array((0.0, 1.0, 4 * spread**3, 0.0))
    total, d_total = 1 + 2 * spread + 2 * spread**4, 2 + 8 * spread**3
    return taps / total, d_taps / total - taps * (d_total / total**2)
