"""Reading -> colour, and the scale that the colours are of."""

from collections import deque

import numpy as np

from tactile_node.colour_map import STEPS as LEVELS
from tactile_node.colour_map import rounded_up
from tactile_node.press_levels import ON_OFF_UNIT, PRESS_BY_UNIT

HELD = 10.0  #: for which the largest reading sets the scale [s]
#: what a person reads: factor and name, by unit
SHOWN_AS = {'Pa': (1e-3, 'kPa'), 'N': (1.0, 'N'), ON_OFF_UNIT: (1.0, '')}


def levels(values: np.ndarray, full_scale: float) -> np.ndarray:
    """Return the index into PALETTE of each of ``values``, uint8; of NaN it is 0, to be marked by the caller."""
    fractions = np.nan_to_num(np.clip(values / full_scale, 0, 1))
    return np.rint(fractions * (LEVELS - 1)).astype(np.uint8)


class FullScale:
    """The reading that has the brightest colour: the largest of the last HELD seconds, rounded up.

    ``fixed``: that reading instead. It is never less than from which on a taxel is pressed, so that noise stays dark.
    """

    def __init__(self, unit: str, fixed: float | None = None):
        self._least = 1.0 if unit == ON_OFF_UNIT else PRESS_BY_UNIT[unit]
        self._fixed = fixed
        self._peaks: deque[tuple[float, float]] = deque()

    def update(self, values: np.ndarray, now: float) -> float:
        """Take a frame, shown at ``now`` [s], and return the scale."""
        if self._fixed:
            return self._fixed
        peak = float(np.fmax.reduce(values, axis=None, initial=self._least))  # fmax leaves NaN out
        while self._peaks and (self._peaks[-1][1] <= peak or self._peaks[-1][0] > now):
            self._peaks.pop()  # it can never be the largest again
        self._peaks.append((now, peak))
        while now - self._peaks[0][0] > HELD:
            self._peaks.popleft()
        return rounded_up(self._peaks[0][1])
