"""Define press and release thresholds of taxels, and recognise on/off taxels."""

from dataclasses import dataclass

import numpy as np

from tactile_node.errors import ConfigurationError


def are_on_off(values: np.ndarray) -> bool:
    """Return True if all ``values`` are 0 or one other number above 0. NaN (no valid value) is ignored.

    >>> are_on_off(np.array([0.0, 5.0, np.nan])), are_on_off(np.array([0.0, 5.0, 2.0]))
    (True, False)
    """
    highest = np.fmax.reduce(values, axis=None, initial=0.0)
    count = np.count_nonzero((values == 0) | (values == highest))
    return bool(count == values.size or count + np.count_nonzero(np.isnan(values)) == values.size)


PRESS_FRACTION = 0.3    #: Press threshold for an array without a unit, as a fraction of the full scale.
RELEASE_FRACTION = 0.2  #: Release threshold for an array without a unit, as a fraction of the full scale.
SMALLEST_CONTACT = 4    #: Number of taxels in the smallest contact that is reported.


@dataclass(frozen=True)
class PressThresholds:
    """Fixed thresholds. A taxel becomes pressed at or above ``press`` and is released below ``release``.

    Parameters
    ----------
    press : float
        Press threshold in the unit of the taxel values, finite.
    release : float
        Release threshold in the unit of the taxel values, at most ``press``.

    Raises
    ------
    ConfigurationError
        Raised unless 0 < release <= press < infinity.
    """

    press: float
    release: float

    def __post_init__(self) -> None:
        try:
            is_usable = bool(0 < self.release <= self.press < np.inf)
        except (TypeError, ValueError):  # ``press`` or ``release`` is not a number
            is_usable = False
        if not is_usable:
            raise ConfigurationError(
                'press and release thresholds', expected='0 < release <= press, finite',
                got=f'press {self.press}, release {self.release}',
                remedy='Give both in the unit of the taxel values, with release a little lower than press.')

    @classmethod
    def of_full_scale(cls, full_scale: float, press: float = PRESS_FRACTION,
                      release: float | None = None) -> 'PressThresholds':
        """Return thresholds that are fractions of the full scale.

        Parameters
        ----------
        full_scale : float
            Highest value that a taxel can read.
        press : float
            Press threshold as a fraction of ``full_scale``.
        release : float or None
            Release threshold as a fraction of ``full_scale``; None for RELEASE_FRACTION, or for ``press`` if that is
            lower.

        Raises
        ------
        ConfigurationError
            Raised unless 0 < release <= press and both thresholds are finite.

        Examples
        --------
        >>> PressThresholds.of_full_scale(100.0)
        PressThresholds(press=30.0, release=20.0)
        """
        if release is None:
            release = min(RELEASE_FRACTION, press)
        return cls(press * full_scale, release * full_scale)
