"""What a node reports of the clocks of the drivers whose frames it works on."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from tactile_node.delay.clock_offset import ClockOffset
from tactile_node.errors import InputError

LONGEST_LEAD = 1e9  #: s: no clock is set back by more


class DriverClock(NamedTuple):
    """The wall clock of a driver's host against that of ours."""

    host: ClockOffset = ClockOffset()
    stamps_ahead: float = 0.0  #: by which stamps of its frames are ahead of its host's clock [s]; NaN: of a replay
    unanswered: int = 0        #: questions that brought no usable answer in time

    @property
    def stamps_offset(self) -> float:
        """By which stamps of the driver's frames are ahead of the clock of our host [s]; NaN: not known."""
        return self.host.offset + self.stamps_ahead

    def is_apart(self, limit: float) -> bool:
        """Whether the stamps are apart by more than ``limit`` [s] for certain.

        >>> DriverClock(ClockOffset(-0.2, 0.001)).is_apart(0.05), DriverClock(ClockOffset(0.3, 0.4)).is_apart(0.05)
        (True, False)
        >>> DriverClock(ClockOffset()).is_apart(0.05)
        False
        """
        return abs(self.stamps_offset) > limit + self.host.bound


def stamps_ahead_of(value: float) -> float:
    """Return what an answer has as ``stamps_ahead``. Raises InputError for what no driver sends."""
    if not (math.isnan(value) or 0 <= value < LONGEST_LEAD):
        raise InputError('stamps_ahead', expected=f'0 to {LONGEST_LEAD:g} s, or NaN', got=f'{value}',
                         remedy='Leave the answer out.')
    return value


def clocks_text(clocks: Mapping[str, DriverClock], limit: float) -> str:
    """Return the sentence on those that are apart by more than ``limit`` [s]; empty: none is."""
    return '; '.join(
        f'stamps of {driver} are {clock.stamps_offset:+.3f} s from the clock of this host (+-{clock.host.bound:.3f}): '
        'tf lookups at them fail here, ages are right'
        for driver, clock in clocks.items() if clock.is_apart(limit))


def clock_values(clocks: Mapping[str, DriverClock]) -> dict[str, str]:
    """Return keys and values of a diagnostic; of several drivers, of the one whose stamps are farthest apart."""
    driver, clock = max(clocks.items(), key=lambda item: _distance(item[1]), default=('', DriverClock()))
    return {'clock_of': driver, 'clock_offset_s': _known(clock.host.offset, '+.4f'),
            'clock_offset_bound_s': _known(clock.host.bound, '.4f'),
            'clock_age_s': _known(clock.host.age, '.1f'), 'clock_drift_ppm': _known(1e6 * clock.host.drift, '+.0f'),
            'stamps_offset_s': _known(clock.stamps_offset, '+.4f'),
            'clock_unanswered': str(sum(each.unanswered for each in clocks.values()))}


def _distance(clock: DriverClock) -> float:
    return -1.0 if math.isnan(clock.stamps_offset) else abs(clock.stamps_offset)


def _known(value: float, form: str) -> str:
    return f'{value:{form}}' if math.isfinite(value) else 'not known'
