"""What a message must fulfil before a node uses it: one function for each type, None or the reason to drop it.

DDS guarantees the types of the fields, not that they fit together: any node can publish on our topics. Sizes are
checked first, so that no check costs more than the message itself and nothing is allocated by a size that it names.
"""

import math
from array import array
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import TypeVar

import numpy as np
from builtin_interfaces.msg import Duration, Time

from tactile_node.contact.press import PRESS_BY_UNIT
from tactile_node.frames.taxel_frame import TaxelStatus
from tactile_node.grasp.tracker import GraspContact
from tactile_node.ros.shape_messages import SHAPE_OF_NUMBER
from tactile_node.skin.layout import MAX_SIDE
from tactile_skin.msg import ContactFeatures, ContactShape, FeatureRange, Grasp, TaxelArray

MAX_FEATURES = 1000  #: of one message; ours have far fewer
TOLERANCE = 1e-3  #: of probabilities, which are float32
LAST_SECOND = 2**31 - 1  #: of Time; rounding must not go beyond it
NANOSECONDS = 10**9

Message = TypeVar('Message')


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

    @property
    def key(self) -> str:
        """Its name in diagnostics: 'unknown_unit'."""
        return self.name.lower()


#: Returns None for a message that can be used
Check = Callable[[Message], RejectReason | None]


def check_taxel_array(message: TaxelArray) -> RejectReason | None:
    """Check sizes, unit, pitch, codes and stamp; NaN is a value, an infinite number is none."""
    return (_grid(message.rows, message.cols, len(message.values), len(message.status))
            or _scale(message.unit, message.pitch)
            or _codes(message.status, max(TaxelStatus))
            or _taxels(message.values)
            or _time(message.header.stamp))


def check_contact_features(message: ContactFeatures) -> RejectReason | None:
    """Check the taxels as `check_taxel_array` does, and that pattern, contacts and features belong together."""
    return (_grid(message.rows, message.cols, len(message.values), len(message.pattern))
            or (RejectReason.TOO_LARGE if len(message.features) > MAX_FEATURES else None)
            or _scale(message.unit, message.pitch)
            or _codes(message.pattern, 1)
            or _taxels(message.values)
            or _contacts(message)
            or _angles(message.features)
            or _time(message.header.stamp))


def check_contact_shape(message: ContactShape) -> RejectReason | None:
    """Check codes, probabilities, place and fit. A default-constructed message has no probabilities."""
    return (_shapes(message)
            or _probabilities(message.probabilities)
            or _probabilities(message.frame_probabilities)
            or _confidence(message)
            or _place(message)
            or _fit(message)
            or _time(message.header.stamp)
            or _duration(message.held))


def check_grasp(message: Grasp) -> RejectReason | None:
    """Check both sides and the line between them. A side may be unset, "none yet"; both may not."""
    if message.contact not in tuple(GraspContact):
        return RejectReason.UNKNOWN_CODE
    sides = [side for side in message.sides if not _is_unset(side)]
    if not sides:
        return RejectReason.INCONSISTENT
    has_line = message.fresh and message.contact == Grasp.TWO_SIDED
    if message.fresh and len(sides) < 2 or message.stable and not has_line:
        return RejectReason.INCONSISTENT
    middle = message.midpoint
    line = (middle.x, middle.y, middle.z, message.width, message.offset, message.misalignment) if has_line else ()
    return (next((reason for side in sides if (reason := check_contact_shape(side))), None)
            or _finite(message.gap, *line)
            or _time(message.header.stamp)
            or _duration(message.held))


def _grid(rows: int, cols: int, *lengths: int) -> RejectReason | None:
    if not rows or not cols:
        return RejectReason.NO_TAXELS
    if max(rows, cols) > MAX_SIDE:
        return RejectReason.TOO_LARGE
    return RejectReason.WRONG_LENGTH if any(length != rows * cols for length in lengths) else None


def _scale(unit: str, pitch: float) -> RejectReason | None:
    if unit not in PRESS_BY_UNIT:
        return RejectReason.UNKNOWN_UNIT
    return None if 0 < pitch < math.inf else RejectReason.WRONG_PITCH


def _codes(codes: array, last: int) -> RejectReason | None:
    return RejectReason.UNKNOWN_CODE if np.frombuffer(codes, np.uint8).max() > last else None


def _taxels(values: array) -> RejectReason | None:
    return RejectReason.NOT_FINITE if np.isinf(np.frombuffer(values, np.float32)).any() else None


def _contacts(message: ContactFeatures) -> RejectReason | None:
    touched = bool(np.frombuffer(message.pattern, np.uint8).any())
    fits = touched == bool(message.contacts) == bool(message.features)
    return None if fits else RejectReason.INCONSISTENT


def _angles(features: Sequence[FeatureRange]) -> RejectReason | None:
    """NaN is an undefined angle; others become whole degrees."""
    angles = np.array([(feature.min_angle, feature.max_angle) for feature in features])
    return RejectReason.NOT_FINITE if np.isinf(angles).any() else None


def _shapes(message: ContactShape) -> RejectReason | None:
    is_known = message.shape in SHAPE_OF_NUMBER and message.frame_shape in SHAPE_OF_NUMBER
    return None if is_known else RejectReason.UNKNOWN_CODE


def _probabilities(values: np.ndarray) -> RejectReason | None:
    probabilities = np.asarray(values, float)
    if probabilities.shape != (len(SHAPE_OF_NUMBER),):
        return RejectReason.WRONG_LENGTH
    if not np.isfinite(probabilities).all():
        return RejectReason.NOT_FINITE
    is_distribution = probabilities.min() >= 0 and abs(probabilities.sum() - 1) <= TOLERANCE
    return None if is_distribution else RejectReason.WRONG_PROBABILITIES


def _confidence(message: ContactShape) -> RejectReason | None:
    if not math.isfinite(message.confidence):
        return RejectReason.NOT_FINITE
    is_same = abs(message.confidence - message.probabilities[message.shape]) <= TOLERANCE
    return None if is_same else RejectReason.INCONSISTENT


def _place(message: ContactShape) -> RejectReason | None:
    """A shape without taxels is legal: of a pad that is not seen, it has no place and no fit."""
    is_none = message.shape == ContactShape.NONE
    if is_none and message.taxels or message.fit_valid and (is_none or not message.taxels):
        return RejectReason.INCONSISTENT
    return _finite(message.centre_of_pressure.x, message.centre_of_pressure.y) if message.taxels else None


def _fit(message: ContactShape) -> RejectReason | None:
    if not message.fit_valid:
        return None
    if (len(message.dimension_names) != len(message.dimensions)
            or len(message.parameter_names)**2 != len(message.covariance)):
        return RejectReason.WRONG_LENGTH
    place, direction = message.pose.pose.position, message.pose.pose.orientation
    return _finite(place.x, place.y, direction.x, direction.y, direction.z, direction.w, *message.dimensions)


def _finite(*numbers: float) -> RejectReason | None:
    return None if all(map(math.isfinite, numbers)) else RejectReason.NOT_FINITE


def _time(time: Time) -> RejectReason | None:
    return None if 0 <= time.sec < LAST_SECOND and time.nanosec < NANOSECONDS else RejectReason.WRONG_STAMP


def _duration(duration: Duration) -> RejectReason | None:
    return None if duration.sec >= 0 and duration.nanosec < NANOSECONDS else RejectReason.WRONG_STAMP


def _is_unset(side: ContactShape) -> bool:
    """Whether it is the message before the first of its pad."""
    stamp = side.header.stamp
    return not (stamp.sec or stamp.nanosec or side.sequence or side.method or np.any(side.probabilities))
