"""Check a TaxelArray from a topic or a bag before it is used.

Other messages with the same fields share some of these checks.
"""

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import Any, Protocol

import numpy as np

from tactile_node.skin.layout import MAX_SIDE
from tactile_node.taxel_frame import PRESS_BY_UNIT, SkinSide, TaxelStatus

NANOSECONDS = 10**9
#: mask that is True for each `TaxelStatus` code that implies a value
GIVES_VALUE = np.isin(np.arange(256), (TaxelStatus.VALID, TaxelStatus.SATURATED))


class Time(Protocol):
    """Interface of builtin_interfaces/Time and Duration."""

    sec: int
    nanosec: int


class RejectReason(IntEnum):
    """Reason why a message was dropped. The codes never change."""

    NOT_KNOWN = 0
    UNKNOWN_UNIT = 1  #: the unit is not "Pa", "N" or "1"
    NO_TAXELS = 2  #: rows or cols is 0, as in a default-constructed message
    TOO_LARGE = 3  #: the message has more rows, columns or features than any skin
    WRONG_LENGTH = 4  #: the length of an array does not match rows * cols, the classes or the element names
    WRONG_PITCH = 5  #: the pitch is not a length > 0
    UNKNOWN_CODE = 6  #: a number is not a member of its enumeration
    NOT_FINITE = 7  #: a number is NaN or infinite where a finite number is needed
    WRONG_PROBABILITIES = 8  #: a probability is not in 0...1, or the sum of the probabilities is not 1
    WRONG_STAMP = 9  #: a time is before 1970 or after 2038, its ns field is 10^9 or more, or a duration is negative
    INCONSISTENT = 10  #: fields of the message contradict each other
    PROCESSING_FAILED = 11  #: the message passed the checks, but computing or publishing a result raised an error
    MISSING_JOINT = 12  #: a joint needed to compute the gripper opening is missing
    IMPLAUSIBLE_OPENING = 13  #: the computed opening is impossible for a gripper, so the sign, scale or offset is wrong
    STAMP_AHEAD = 14  #: the stamp is far ahead of earlier stamps: it is wrong, or the clock was set forward
    WRONG_SEQUENCE = 15  #: the sequence number is higher than it can be by now
    OTHER_TYPE = 16  #: a publisher uses another version of the message, so the fields would be misread
    OTHER_SOURCE = 17  #: two sources publish on the topic, and it is unknown which source is correct

    @property
    def key(self) -> str:
        """Name of the reason in diagnostics, such as 'unknown_unit'."""
        return self.name.lower()


def check_taxel_array(message: Any) -> RejectReason | None:
    """Return the reason for dropping a TaxelArray, or None if it can be used.

    The function checks sizes, unit, pitch, codes and stamps. A taxel must have a finite value if and only if its status
    code says so. Fields that are missing in the message definition of a bag are treated as not known.
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
    """Check the number of rows and columns, and that each array has one element per taxel."""
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
    """Check that no code is above ``last``. ``codes`` must not be empty."""
    return RejectReason.UNKNOWN_CODE if np.asarray(codes, np.uint8).max() > last else None


def check_taxels(values: Sequence[float], status: Sequence[int]) -> RejectReason | None:
    """Check that a taxel has a value if and only if its status code says so.

    Without this check, a value whose status code means "no value" would be used, and NaN with the code VALID would look
    like an error in this package.
    """
    numbers = np.asarray(values, np.float32)
    if np.isinf(numbers).any():
        return RejectReason.NOT_FINITE
    return None if (GIVES_VALUE[np.asarray(status, np.uint8)] != np.isnan(numbers)).all() \
        else RejectReason.INCONSISTENT


def check_layer(depth: float, deviation: float) -> RejectReason | None:
    """Check the depth of the taxels [m], which is 0 if unknown. A depth without a deviation would seem to be exact."""
    if not (math.isfinite(depth) and math.isfinite(deviation)):
        return RejectReason.NOT_FINITE
    return None if depth > 0 and deviation > 0 or depth == deviation == 0 else RejectReason.INCONSISTENT


def check_sides(sides: int) -> RejectReason | None:
    """Check that a set of sides contains no side other than the four known ones."""
    return RejectReason.UNKNOWN_CODE if sides > sum(SkinSide) else None


def check_finite(*numbers: float) -> RejectReason | None:
    """Check that no number is NaN or infinite."""
    return None if all(map(math.isfinite, numbers)) else RejectReason.NOT_FINITE


def check_time(time: Time) -> RejectReason | None:
    """Check that a stamp lies between 1970 and 2038."""
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
