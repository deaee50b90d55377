"""Provide the gripper's opening: the latest value from one source, unless the value is too old."""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from tactile_node.errors import ConfigurationError


class GapSource(IntEnum):
    """Source of an opening. Grasp.msg uses the same numbers, which must not change."""

    NOT_KNOWN = 0
    PARAMETER = 1
    JOINT_STATES = 2
    TF = 3


class Opening(NamedTuple):
    """The opening at one time.

    ``gap`` is NaN if there is no source, if the source has no value yet, or if the latest value is too old.
    """

    gap: float = math.nan                    #: [m]
    source: GapSource = GapSource.NOT_KNOWN  #: source of the latest value; NOT_KNOWN if there was no value
    age: float = math.inf                    #: age of the latest value on a steady clock [s], or inf if unknown


UNKNOWN_OPENING = Opening()  #: Opening of a gripper without a source, or of a source without a value.

#: Smallest plausible opening [m]. Two skins pressed into each other have an opening below 0.
LOWEST_GAP = -0.01
HIGHEST_GAP = 1.0   #: Largest plausible opening [m].


def is_plausible(gap: float) -> bool:
    """Return True if ``gap`` [m] is a plausible opening, and False for NaN.

    A scale with a wrong sign or unit usually leads to an implausible opening.
    """
    return LOWEST_GAP <= gap <= HIGHEST_GAP


@dataclass(frozen=True)
class LinearGap:
    """Converts a reading (a sum of joint positions, or a distance) to an opening: gap = offset + scale * reading.

    >>> round(LinearGap(offset=0.085, scale=-0.1).gap(0.8), 6)  # a knuckle joint that closes as its angle rises
    0.005
    """

    offset: float = 0.0  #: opening at a reading of 0 [m]
    scale: float = 1.0   #: opening per metre or per radian of the reading

    def __post_init__(self) -> None:
        if not (math.isfinite(self.offset) and math.isfinite(self.scale) and self.scale):
            raise ConfigurationError(
                'opening from a reading', expected='a finite offset, and a finite scale other than 0',
                got=f'offset {self.offset}, scale {self.scale}',
                remedy='Use a negative scale if the gripper closes as the reading rises.')

    def gap(self, reading: float) -> float:
        return self.offset + self.scale * reading

    def reading(self, gap: float) -> float:
        return (gap - self.offset) / self.scale


class LatestGap:
    """Holds the latest value of one source.

    All times come from a steady clock [s], so that a jump of the wall clock has no effect.

    Parameters
    ----------
    source : GapSource
        Source of the values.
    max_age : float
        Age above which a value is no longer used [s].
    """

    def __init__(self, source: GapSource, max_age: float = math.inf):
        if not max_age > 0:
            raise ConfigurationError('age limit of the opening', expected='more than 0 s', got=f'{max_age}',
                                     remedy='Give at least twice the period of the source.')
        self._source = source
        self._max_age = max_age
        self._gap = math.nan
        self._measured = math.nan

    def set(self, gap: float, measured: float) -> None:
        """Store a value measured at the time ``measured``. A value of NaN withdraws the previous value."""
        self._gap = gap
        self._measured = measured

    def current(self, now: float) -> Opening:
        """Return the opening at ``now``, with NaN as its gap if the latest value is too old."""
        if math.isnan(self._gap):
            return UNKNOWN_OPENING
        return opening(self._gap, self._source, max(0.0, now - self._measured), self._max_age)


def opening(gap: float, source: GapSource, age: float, max_age: float) -> Opening:
    """Return an opening, with NaN as its gap if ``age`` exceeds ``max_age`` [s]."""
    return Opening(gap if age <= max_age else math.nan, source, age)
