"""What a TaxelArray must fulfil before it is used, from a topic or a bag, and the parts that other messages share."""

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import Any, Protocol

import numpy as np

from tactile_node.skin.layout import MAX_SIDE
from tactile_node.taxel_frame import PRESS_BY_UNIT, SkinSide, TaxelStatus

NANOSECONDS = 10**9
#: By TaxelStatus, to its largest number: whether a taxel of this status has a value
GIVES_VALUE = np.isin(np.arange(256), (TaxelStatus.VALID, TaxelStatus.SATURATED))


class Time(Protocol):
    """builtin_interfaces/Time or Duration."""

    sec: int
    nanosec: int


class RejectReason(IntEnum):
    """Why a message was dropped. The codes are stable."""

    NOT_KNOWN = 0
    UNKNOWN_UNIT = 1  #: not "Pa", "N" or "1"
    NO_TAXELS = 2  #: rows or cols is 0, as in a default-constructed message
    TOO_LARGE = 3  #: more rows, columns or features than any skin has
    WRONG_LENGTH = 4  #: an array that does not fit rows * cols, the classes or the names of its elements
    WRONG_PITCH = 5  #: not a length > 0
    UNKNOWN_CODE = 6  #: a number that its enumeration does not have
    NOT_FINITE = 7  #: NaN or infinite where a number is needed
    WRONG_PROBABILITIES = 8  #: not in 0...1, or their sum is not 1
    WRONG_STAMP = 9  #: a time before 1970, after 2038, or with 10^9 ns and more; a duration below 0
    INCONSISTENT = 10  #: fields that contradict each other
    PROCESSING_FAILED = 11  #: the message passed the checks, and its processing raised an error
    MISSING_JOINT = 12  #: one that the opening of the gripper is made of
    IMPLAUSIBLE_OPENING = 13  #: no gripper is opened so far: a wrong sign, scale or offset
    STAMP_AHEAD = 14  #: its stamp runs ahead of all before: a false message, or a clock that was set forward
    WRONG_SEQUENCE = 15  #: a sequence number that cannot be yet
    OTHER_TYPE = 16  #: a publisher of the topic has another version of the message: values are read from wrong places
    OTHER_SOURCE = 17  #: two sources send on the topic: which of them is the right one is not known

    @property
    def key(self) -> str:
        """Its name in diagnostics: 'unknown_unit'."""
        return self.name.lower()


def check_taxel_array(message: Any) -> RejectReason | None:
    """Check sizes, unit, pitch, codes and stamp; a taxel has a finite value exactly where its code gives one.

    Fields that the definition of a bag lacks are not known.
    """
    return (check_grid(message.rows, message.cols, len(message.values), len(message.status))
            or check_scale(message.unit, message.pitch)
            or check_codes(message.status, max(TaxelStatus))
            or check_taxels(message.values, message.status)
            or check_layer(getattr(message, 'layer_depth', 0.0), getattr(message, 'layer_deviation', 0.0))
            or check_sides(getattr(message, 'finger_ends', 0))
            or _tpdo_ages(getattr(message, 'tpdo_ages', ()), getattr(message, 'taxel_tpdos', ()), len(message.values))
            or check_time(message.header.stamp)
            or (check_duration(message.age) if hasattr(message, 'age') else None))


def check_grid(rows: int, cols: int, *lengths: int) -> RejectReason | None:
    """Check the sides of a pad, and that arrays have an element for each taxel."""
    if not rows or not cols:
        return RejectReason.NO_TAXELS
    if max(rows, cols) > MAX_SIDE:
        return RejectReason.TOO_LARGE
    return RejectReason.WRONG_LENGTH if any(length != rows * cols for length in lengths) else None


def check_scale(unit: str, pitch: float) -> RejectReason | None:
    """Check the unit and the pitch [m]."""
    if unit not in PRESS_BY_UNIT:
        return RejectReason.UNKNOWN_UNIT
    return None if 0 < pitch < math.inf else RejectReason.WRONG_PITCH


def check_codes(codes: Sequence[int], last: int) -> RejectReason | None:
    """Check that no code is above ``last``; there is at least one."""
    return RejectReason.UNKNOWN_CODE if np.asarray(codes, np.uint8).max() > last else None


def check_taxels(values: Sequence[float], status: Sequence[int]) -> RejectReason | None:
    """Check that a taxel has a value where its code gives one.

    A value without a code that gives one would be taken for valid, and NaN under VALID for a defect of ours.
    """
    numbers = np.asarray(values, np.float32)
    if np.isinf(numbers).any():
        return RejectReason.NOT_FINITE
    return None if (GIVES_VALUE[np.asarray(status, np.uint8)] != np.isnan(numbers)).all() \
        else RejectReason.INCONSISTENT


def check_layer(depth: float, deviation: float) -> RejectReason | None:
    """Check the depth of the taxels [m]: without its deviation it would count for exact; 0: not known."""
    if not (math.isfinite(depth) and math.isfinite(deviation)):
        return RejectReason.NOT_FINITE
    return None if depth > 0 and deviation > 0 or depth == deviation == 0 else RejectReason.INCONSISTENT


def check_sides(sides: int) -> RejectReason | None:
    """Check that a set of sides has no other than the four."""
    return RejectReason.UNKNOWN_CODE if sides > sum(SkinSide) else None


def check_finite(*numbers: float) -> RejectReason | None:
    """Check that no number is NaN or infinite."""
    return None if all(map(math.isfinite, numbers)) else RejectReason.NOT_FINITE


def check_time(time: Time) -> RejectReason | None:
    """Check that a stamp is from 1970 to 2038."""
    return None if 0 <= time.sec < 2**31 - 1 and time.nanosec < NANOSECONDS else RejectReason.WRONG_STAMP


def check_duration(duration: Time) -> RejectReason | None:
    """Check that an age is 0 or more."""
    return None if duration.sec >= 0 and duration.nanosec < NANOSECONDS else RejectReason.WRONG_STAMP


def _tpdo_ages(ages: Sequence[float], indices: Sequence[int], taxels: int) -> RejectReason | None:
    if not len(ages) and not len(indices):
        return None
    if len(indices) != taxels or len(ages) > taxels:
        return RejectReason.WRONG_LENGTH
    if not len(ages) or max(indices) >= len(ages):
        return RejectReason.UNKNOWN_CODE
    return check_finite(*ages) or (RejectReason.WRONG_STAMP if min(ages) < 0 else None)
