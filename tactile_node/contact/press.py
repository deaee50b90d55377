"""From which value on a taxel is pressed, and below which it is released; whether taxels are on/off."""

from dataclasses import dataclass

import numpy as np

from tactile_node.errors import ConfigurationError


def are_on_off(values: np.ndarray) -> bool:
    """Return whether all ``values``, finite or NaN (no valid value), are 0 or one other number above it.

    >>> are_on_off(np.array([0.0, 5.0, np.nan])), are_on_off(np.array([0.0, 5.0, 2.0]))
    (True, False)
    """
    highest = np.fmax.reduce(values, axis=None, initial=0.0)
    count = np.count_nonzero((values == 0) | (values == highest))
    return bool(count == values.size or count + np.count_nonzero(np.isnan(values)) == values.size)


#: Thresholds of arrays without a unit, as fractions of the full scale.
PRESS_FRACTION = 0.3
RELEASE_FRACTION = 0.2
SMALLEST_CONTACT = 4  #: taxels of the smallest contact that is reported


@dataclass(frozen=True)
class PressThresholds:
    """A taxel is pressed at ``press`` or above and is released below ``release``, in the unit of its values.

    Raises ConfigurationError unless 0 < release <= press, press finite.
    """

    press: float
    release: float

    def __post_init__(self) -> None:
        try:
            is_usable = bool(0 < self.release <= self.press < np.inf)
        except (TypeError, ValueError):  # no numbers
            is_usable = False
        if not is_usable:
            raise ConfigurationError(
                'press and release thresholds', expected='0 < release <= press, finite',
                got=f'press {self.press}, release {self.release}',
                remedy='Give both in the unit of the taxel values, release a little lower than press.')

    @classmethod
    def of_full_scale(cls, full_scale: float, press: float = PRESS_FRACTION,
                      release: float | None = None) -> 'PressThresholds':
        """Return thresholds that are fractions of ``full_scale``.

        ``release`` None: RELEASE_FRACTION, or ``press`` where that is lower. Raises ConfigurationError.

        >>> PressThresholds.of_full_scale(100.0)
        PressThresholds(press=30.0, release=20.0)
        """
        if release is None:
            release = min(RELEASE_FRACTION, press)
        return cls(press * full_scale, release * full_scale)
