"""How far the gripper is open: the last value of a source, as long as it is not too old."""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from tactile_node.errors import ConfigurationError


class GapSource(IntEnum):
    """Where an opening comes from. The codes are stable (Grasp.msg mirrors them)."""

    NOT_KNOWN = 0
    PARAMETER = 1
    JOINT_STATES = 2
    TF = 3


class Opening(NamedTuple):
    """The opening at one time. ``gap`` is NaN while there is no source, no value yet, or only one that is too old."""

    gap: float = math.nan                     #: [m]
    source: GapSource = GapSource.NOT_KNOWN   #: source of the last value; NOT_KNOWN: there was none
    age: float = math.inf                     #: age of the last value, on a steady clock [s]; inf: not known


#: The opening of a gripper without a source, or of a source without a value.
UNKNOWN_OPENING = Opening()

#: What a reading may give [m]: two skins pressed into each other are a little less than closed; no gripper opens wider.
LOWEST_GAP, HIGHEST_GAP = -0.01, 1.0


def is_plausible(gap: float) -> bool:
    """Whether a gripper can be opened by ``gap`` [m]; NaN is not. A wrong sign or unit of the scale shows here."""
    return LOWEST_GAP <= gap <= HIGHEST_GAP


@dataclass(frozen=True)
class LinearGap:
    """gap = offset + scale * reading. A reading is a sum of joint positions, or a distance.

    >>> round(LinearGap(offset=0.085, scale=-0.1).gap(0.8), 6)  # a knuckle joint that closes as its angle rises
    0.005
    """

    offset: float = 0.0  #: [m]
    scale: float = 1.0   #: metres of opening for a metre or a radian of the reading

    def __post_init__(self) -> None:
        if not (math.isfinite(self.offset) and math.isfinite(self.scale) and self.scale):
            raise ConfigurationError(
                'opening from a reading', expected='finite offset and scale, scale not 0',
                got=f'offset {self.offset}, scale {self.scale}', remedy='Negative: the gripper closes as it rises.')

    def gap(self, reading: float) -> float:
        return self.offset + self.scale * reading

    def reading(self, gap: float) -> float:
        return (gap - self.offset) / self.scale


class LatestGap:
    """Holds the last value of one source. Times are of a steady clock [s]: a jump of the wall clock changes nothing.

    ``max_age``: from which on a value is too old to be used [s].
    """

    def __init__(self, source: GapSource, max_age: float = math.inf):
        if not max_age > 0:
            raise ConfigurationError('age limit of the opening', expected='more than 0 s', got=f'{max_age}',
                                     remedy='Give at least two periods of the source.')
        self._source = source
        self._max_age = max_age
        self._gap = math.nan
        self._measured = math.nan

    def set(self, gap: float, measured: float) -> None:
        """Take a value that was measured at ``measured``; NaN withdraws the one before."""
        self._gap = gap
        self._measured = measured

    def current(self, now: float) -> Opening:
        """Return the opening at ``now``; its gap is NaN once the last value is too old."""
        if math.isnan(self._gap):
            return UNKNOWN_OPENING
        return opening(self._gap, self._source, max(0.0, now - self._measured), self._max_age)


def opening(gap: float, source: GapSource, age: float, max_age: float) -> Opening:
    """Return the opening with a gap that is NaN once it is older than ``max_age`` [s]."""
    return Opening(gap if age <= max_age else math.nan, source, age)
