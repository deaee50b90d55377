"""Show taxel values as colours, from dark for no load to bright for full scale.

Saturated taxels and taxels without a value have special colours.
"""

from collections import deque

import numpy as np

from tactile_node.taxel_frame import ON_OFF_UNIT, PRESS_BY_UNIT, read_only

#: RGB values of matplotlib's colour map inferno at 17 even steps (N. J. Smith, S. van der Walt; CC0). The lightness of
#: inferno rises evenly.
INFERNO = ((0, 0, 4), (11, 7, 36), (33, 12, 74), (61, 9, 101), (87, 16, 110), (113, 25, 110), (138, 34, 106),
           (163, 44, 97), (188, 55, 84), (208, 69, 69), (227, 89, 51), (241, 113, 31), (249, 140, 10), (252, 170, 15),
           (249, 201, 50), (242, 232, 101), (252, 255, 164))
STEPS = 256                        #: Number of different colours for values.

#: Round numbers to which a scale is rounded up. The ticks of the scale use the same steps.
ROUND_STEPS = 1.0, 2.0, 5.0, 10.0
HELD_TIME = 10.0                   #: Time for which a peak value sets the colour scale [s].
NO_VALUE = STEPS                   #: Colour number of a taxel without a value.
SATURATED = STEPS + 1              #: Colour number of a taxel at the end of its range.
NO_VALUE_RGB = (128, 128, 128)     #: Grey, which inferno does not contain.
SATURATED_RGB = (60, 210, 80)      #: Green, which inferno does not contain.


def _rgb_table() -> np.ndarray:
    anchors = np.array(INFERNO, float)
    places = np.linspace(0, len(anchors) - 1, STEPS)
    of_values = np.stack([np.interp(places, np.arange(len(anchors)), channel) for channel in anchors.T], axis=1)
    return read_only(np.vstack([np.rint(of_values), NO_VALUE_RGB, SATURATED_RGB]).astype(np.uint8))


RGB_TABLE = _rgb_table()     #: Colour of each colour number, uint8 (SATURATED + 1, 3).
PALETTE = RGB_TABLE[:STEPS]  #: Colours of values, from 0 to the brightest, uint8 (STEPS, 3).


def rounded_up(value: float) -> float:
    """Return the smallest of 1, 2, 5, 10, 20, ... that is at least ``value``.

    >>> rounded_up(37e3), rounded_up(1.0)
    (50000.0, 1.0)
    """
    decade = 10.0 ** np.floor(np.log10(value))
    return float(next(step * decade for step in ROUND_STEPS if value <= step * decade * (1 + 1e-9)))


def levels(values: np.ndarray, full_scale: float) -> np.ndarray:
    """Return the index into PALETTE for each of ``values``, intp.

    The index of NaN is 0, so the caller has to mark NaN separately.
    """
    return np.rint(np.clip(np.nan_to_num(values) / full_scale, 0.0, 1.0) * (STEPS - 1)).astype(np.intp)


def value_colours(values: np.ndarray, full_scale: float) -> np.ndarray:
    """Return the RGB colour of each of ``values``, uint8, shape (..., 3). NaN is grey."""
    return RGB_TABLE[np.where(np.isnan(values), NO_VALUE, levels(values, full_scale))]


class ColourScale:
    """Assigns colour numbers to the values of one pad.

    If every frame were scaled separately, noise would look as bright as a contact. The scale therefore follows the
    highest value of the last HELD_TIME seconds, rounded up, and is never below the press threshold.

    Parameters
    ----------
    fixed : float
        Value shown in the brightest colour [unit of the values]. Higher values get the same colour. With 0, the scale
        follows the values.
    """

    def __init__(self, fixed: float = 0.0):
        self._fixed = fixed
        self._peaks: deque[tuple[float, float]] = deque()  # stamps and values, the highest value first

    def full_scale(self, values: np.ndarray, unit: str, stamp: float) -> float:
        """Return the value shown in the brightest colour.

        Parameters
        ----------
        values : np.ndarray
            Taxel values of the present frame; NaN if a taxel has no valid value.
        unit : str
            Unit of the values.
        stamp : float
            Stamp of the present frame [s].
        """
        if self._fixed:
            return self._fixed
        least = 1.0 if unit == ON_OFF_UNIT else PRESS_BY_UNIT[unit]
        peak = float(np.max(values, initial=least, where=np.isfinite(values)))
        while self._peaks and (self._peaks[-1][1] <= peak or self._peaks[-1][0] > stamp):
            self._peaks.pop()  # this peak can no longer become the largest
        self._peaks.append((stamp, peak))
        while stamp - self._peaks[0][0] > HELD_TIME:
            self._peaks.popleft()
        return rounded_up(self._peaks[0][1])

    def numbers(self, values: np.ndarray, saturated: np.ndarray, unit: str, stamp: float) -> np.ndarray:
        """Return the colour number of each taxel, intp.

        Parameters
        ----------
        values, unit, stamp
            As for `full_scale`.
        saturated : np.ndarray
            Taxels at the end of their range, bool.

        Examples
        --------
        >>> ColourScale(100.0).numbers(np.array([-1.0, 50.0, 200.0, np.nan]), np.zeros(4, bool), 'Pa', 0.0).tolist()
        [0, 128, 255, 256]
        """
        scale = self.full_scale(values, unit, stamp)
        return np.where(np.isnan(values), NO_VALUE, np.where(saturated, SATURATED, levels(values, scale)))
