"""The gripper's opening, which is known only while the latest value of its source is not too old."""

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


def opening(gap: float, source: GapSource, age: float, max_age: float = math.inf) -> Opening:
    """Return the opening of a source whose latest value is ``gap`` [m], or UNKNOWN_OPENING if ``gap`` is NaN.

    The gap is NaN if ``age`` [s], on a steady clock, exceeds ``max_age`` [s].
    """
    if math.isnan(gap):
        return UNKNOWN_OPENING
    return Opening(gap if age <= max_age else math.nan, source, max(0.0, age))
