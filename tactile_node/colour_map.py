"""Taxel values as colours: dark is nothing, bright is the full scale, and what is no plain value has a colour apart."""

import math

import numpy as np

from tactile_node.taxel_frame import PRESS_BY_UNIT, read_only

#: matplotlib's inferno (N. J. Smith, S. van der Walt; CC0) at 17 even steps, rgb; its lightness rises evenly.
INFERNO = ((0, 0, 4), (11, 7, 36), (33, 12, 74), (61, 9, 101), (87, 16, 110), (113, 25, 110), (138, 34, 106),
           (163, 44, 97), (188, 55, 84), (208, 69, 69), (227, 89, 51), (241, 113, 31), (249, 140, 10), (252, 170, 15),
           (249, 201, 50), (242, 232, 101), (252, 255, 164))
STEPS = 256  #: colours of values
ROUND_STEPS = 1.0, 2.0, 5.0, 10.0  #: to which a scale is rounded up, and those of its ticks
NO_VALUE, SATURATED = STEPS, STEPS + 1  #: numbers of the colours of taxels without a value, at the end of their range
NO_VALUE_RGB, SATURATED_RGB = (128, 128, 128), (60, 210, 80)  #: grey and green, which inferno does not have


def _rgb_table() -> np.ndarray:
    anchors = np.array(INFERNO, float)
    places = np.linspace(0, len(anchors) - 1, STEPS)
    of_values = np.stack([np.interp(places, np.arange(len(anchors)), channel) for channel in anchors.T], axis=1)
    return read_only(np.vstack([np.rint(of_values), NO_VALUE_RGB, SATURATED_RGB]).astype(np.uint8))


RGB_TABLE = _rgb_table()  #: the colour of each number, uint8, shape (SATURATED + 1, 3)
PALETTE = RGB_TABLE[:STEPS]  #: colours of values, from 0 to the brightest, uint8 (STEPS, 3)


def rounded_up(value: float) -> float:
    """Return the next of 1, 2, 5, 10, 20 ... from ``value`` on.

    >>> rounded_up(37e3), rounded_up(1.0)
    (50000.0, 1.0)
    """
    decade = 10.0 ** np.floor(np.log10(value))
    return float(next(step * decade for step in ROUND_STEPS if value <= step * decade * (1 + 1e-9)))


def levels(values: np.ndarray, full_scale: float) -> np.ndarray:
    """Return the index into PALETTE of each of ``values``, intp; of NaN it is 0, to be marked by the caller."""
    return np.rint(np.clip(np.nan_to_num(values) / full_scale, 0.0, 1.0) * (STEPS - 1)).astype(np.intp)


class ColourScale:
    """Numbers of colours for the values of one pad.

    ``full_scale``: the value of the brightest colour [unit of the values], which higher ones have too; 0: the highest
    value so far, at least that from which on a taxel is pressed. A scale of each frame alone would show noise as bright
    as a contact.
    """

    def __init__(self, full_scale: float = 0.0):
        self._fixed = full_scale
        self._highest = 0.0

    def numbers(self, values: np.ndarray, saturated: np.ndarray, unit: str) -> np.ndarray:
        """Return the number of each taxel's colour, intp, of the shape of ``values`` [unit], NaN = no valid value.

        >>> ColourScale(100.0).numbers(np.array([-1.0, 50.0, 200.0, np.nan]), np.zeros(4, bool), 'Pa').tolist()
        [0, 128, 255, 256]
        """
        scale = self._fixed or self._following(values, unit)
        return np.where(np.isnan(values), NO_VALUE, np.where(saturated, SATURATED, levels(values, scale)))

    def _following(self, values: np.ndarray, unit: str) -> float:
        highest = float(np.fmax.reduce(values, axis=None, initial=0.0))
        if math.isfinite(highest):
            self._highest = max(self._highest, highest)
        return max(self._highest, PRESS_BY_UNIT[unit])
