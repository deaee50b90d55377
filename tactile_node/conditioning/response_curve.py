"""How the taxels of a skin answer to pressure: a curve from their readings to pressures, the same for all taxels."""

from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.read_only import read_only


class ResponseCurve(NamedTuple):
    """Straight lines between nodes, from (0, 0) upwards; the same for negative readings, mirrored.

    Beyond the last node the last line goes on.
    """

    readings: np.ndarray   #: (k,), of a calibrated zero, rising from 0 [unit of the taxels]
    pressures: np.ndarray  #: (k,), rising from 0 [the same unit]

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return the pressures of ``values``, same shape and type; NaN stays NaN.

        >>> curve = ResponseCurve(np.array((0.0, 1.0, 2.0)), np.array((0.0, 1.0, 4.0)))
        >>> curve(np.array((-1.0, 0.5, 3.0, np.nan))).tolist()
        [-1.0, 0.5, 7.0, nan]
        """
        size = np.abs(values)
        last = (self.pressures[-1] - self.pressures[-2]) / (self.readings[-1] - self.readings[-2])
        beyond = np.maximum(size - self.readings[-1], 0.0) * last
        found: np.ndarray = np.copysign(np.interp(size, self.readings, self.pressures) + beyond, values)
        return found.astype(values.dtype, copy=False)


def make_curve(readings: list[float], pressures: list[float]) -> ResponseCurve:
    """Make a curve of nodes. Raises ConfigurationError unless both rise from 0."""
    for name, nodes in (('readings', readings), ('pressures', pressures)):
        array = np.array(nodes, float)
        if len(array) < 2 or len(readings) != len(pressures) or array[0] != 0 or not (np.diff(array) > 0).all() \
                or not np.isfinite(array).all():
            raise ConfigurationError(f'{name} of a response curve', got=str(nodes)[:80],
                                     expected='two or more numbers that rise from 0, as many readings as pressures',
                                     remedy='Calibrate the skin again (tactile calibrate).')
    return ResponseCurve(read_only(np.array(readings, float)), read_only(np.array(pressures, float)))
