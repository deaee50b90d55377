"""Check a message before a node uses it. Each message type has a function that returns None or the reason to drop it.

The rules for a TaxelArray are in `skin/taxel_array.py`, because the rules also apply to bags.

DDS guarantees only the types of the fields. Any node can publish on these topics, and the fields of a message may
contradict each other. The size of each array is checked first, so that a check never costs more than the message
itself, and never allocates memory for a size that a message merely claims.
"""

import math
from array import array
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from tactile_node.contact.pattern import MOST_LABELS
from tactile_node.ros.motion_messages import check_motion
from tactile_node.ros.shape_messages import NAME_OF_NUMBER
from tactile_node.shape.recognition import UnknownReason
from tactile_node.skin.taxel_array import (
    RejectReason,
    check_codes,
    check_duration,
    check_finite,
    check_grid,
    check_layer,
    check_scale,
    check_sides,
    check_taxels,
    check_time,
)
from tactile_node.skin.taxel_array import check_taxel_array as check_taxel_array
from tactile_node.taxel_frame import TaxelStatus
from tactile_skin.msg import Contact, ContactShape, Grasp, GraspSides

MAX_CLASSES = 1000  #: maximum number of classes in one message, far more than this package defines
PROBABILITY_TOLERANCE = 1e-3  #: rounding tolerance for probabilities, which are float32
SHAPE_NUMBERS_KNOWN = frozenset((*NAME_OF_NUMBER, ContactShape.OTHER))
UNKNOWN_REASONS = frozenset(UnknownReason) - {UnknownReason.NOT_KNOWN}

Message = TypeVar('Message')
#: function that returns None for a usable message, otherwise the reason to drop the message
Check = Callable[[Message], RejectReason | None]


def check_contact(message: Contact) -> RejectReason | None:
    """Check the taxels as `check_taxel_array` does, then check that labels, counts and state are consistent."""
    return (check_grid(message.rows, message.cols, len(message.values), len(message.status), len(message.labels))
            or (RejectReason.TOO_LARGE if len(message.contact_taxels) > len(message.labels) else None)
            or check_scale(message.unit, message.pitch)
            or check_codes(message.status, max(TaxelStatus))
            or check_taxels(message.values, message.status)
            or _noise_floor(message)
            or check_layer(message.layer_depth, message.layer_deviation)
            or check_sides(message.finger_ends)
            or _state(message.state, message.contacts)
            or _labels(message)
            or check_times(message))


def check_contact_shape(message: ContactShape) -> RejectReason | None:
    """Check codes, classes, probabilities, position and fit. A default-constructed message is not a valid shape."""
    return (_shapes(message)
            or _classes(message)
            or _probabilities(message.probabilities)
            or _probabilities(message.frame_probabilities)
            or _confidence(message)
            or _counts(message)
            or _place(message)
            or _fit(message)
            or check_motion(message.motion)
            or check_times(message)
            or check_duration(message.held))


def _noise_floor(message: Contact) -> RejectReason | None:
    """Check the noise floor, in which NaN means that the noise of a taxel is not known."""
    if not len(message.noise_floor):
        return None
    if len(message.noise_floor) != len(message.values):
        return RejectReason.WRONG_LENGTH
    noise = np.frombuffer(message.noise_floor, np.float32)
    return RejectReason.NOT_FINITE if (np.isinf(noise) | (noise < 0)).any() else None


def _state(state: int, contacts: int) -> RejectReason | None:
    if not Contact.NOT_SEEN <= state <= Contact.TOUCHED:
        return RejectReason.UNKNOWN_CODE
    return None if (state == Contact.TOUCHED) == bool(contacts) else RejectReason.INCONSISTENT


def _labels(message: Contact) -> RejectReason | None:
    """Check that each contact has a label and a count, and that a pad reported as empty was seen."""
    if len(message.contact_taxels) != min(message.contacts, MOST_LABELS):
        return RejectReason.WRONG_LENGTH
    if not message.smallest_contact:
        return RejectReason.INCONSISTENT
    if message.state != Contact.TOUCHED and message.pad_seen != (message.state == Contact.EMPTY):
        return RejectReason.INCONSISTENT
    labelled = np.bincount(np.frombuffer(message.labels, np.uint8))[1:]
    fits = labelled.all() and np.array_equal(labelled, message.contact_taxels)
    return None if fits else RejectReason.INCONSISTENT


def _shapes(message: ContactShape) -> RejectReason | None:
    is_known = message.shape in SHAPE_NUMBERS_KNOWN and message.frame_shape in SHAPE_NUMBERS_KNOWN
    if not is_known or message.unknown_reason not in UNKNOWN_REASONS:
        return RejectReason.UNKNOWN_CODE
    is_unknown = message.shape == ContactShape.UNKNOWN
    return None if is_unknown == (message.unknown_reason != ContactShape.NOT_UNKNOWN) else RejectReason.INCONSISTENT


def _classes(message: ContactShape) -> RejectReason | None:
    """Check that the class lists are consistent, and that each name matches its shape code."""
    names = message.class_names
    if len(names) > MAX_CLASSES:
        return RejectReason.TOO_LARGE
    if len({len(names), len(message.probabilities), len(message.frame_probabilities)}) > 1:
        return RejectReason.WRONG_LENGTH
    named = (message.class_name, message.frame_class_name)
    numbers = (message.shape, message.frame_shape)
    fits = all(name in names and is_named(number, name) for name, number in zip(named, numbers))
    return None if fits and len(set(names)) == len(names) else RejectReason.INCONSISTENT


def is_named(number: int, name: str) -> bool:
    if number == ContactShape.OTHER:
        return bool(name) and name not in NAME_OF_NUMBER.values()
    return name == NAME_OF_NUMBER[number]


def _probabilities(values: array) -> RejectReason | None:
    probabilities = np.asarray(values, float)
    if not np.isfinite(probabilities).all():
        return RejectReason.NOT_FINITE
    is_distribution = probabilities.min() >= 0 and abs(probabilities.sum() - 1) <= PROBABILITY_TOLERANCE
    return None if is_distribution else RejectReason.WRONG_PROBABILITIES


def _confidence(message: ContactShape) -> RejectReason | None:
    if not math.isfinite(message.confidence):
        return RejectReason.NOT_FINITE
    probability = message.probabilities[message.class_names.index(message.class_name)]
    return None if abs(message.confidence - probability) <= PROBABILITY_TOLERANCE else RejectReason.INCONSISTENT


def _counts(message: ContactShape) -> RejectReason | None:
    """Check that an empty pad was seen, that contacts have an area, and that no count of taxels exceeds its total."""
    fits = (message.others_present == (message.contacts > 1)
            and (message.shape != ContactShape.NONE or message.pad_seen and not message.contacts)
            and not any(area <= 0 for area in message.contact_areas)
            and max(message.hidden_taxels, message.saturated_taxels) <= message.taxels
            and max(message.hidden_ring_taxels, message.saturated_ring_taxels) <= message.ring_taxels)
    if len(message.contact_areas) != min(message.contacts, MOST_LABELS):
        return RejectReason.WRONG_LENGTH
    return check_finite(*message.contact_areas) if fits else RejectReason.INCONSISTENT


def _place(message: ContactShape) -> RejectReason | None:
    """Check position and fit. If a pad is not seen, its shape may lack taxels, a position and a fit."""
    is_none = message.shape == ContactShape.NONE
    if any(map(math.isinf, message.pressure_slope)):
        return RejectReason.NOT_FINITE
    if is_none and message.taxels or message.fit_valid and (is_none or not message.taxels):
        return RejectReason.INCONSISTENT
    if not message.taxels or message.unknown_reason == ContactShape.NOT_SEEN:
        return None
    return check_finite(message.centre_of_pressure.x, message.centre_of_pressure.y)


def _fit(message: ContactShape) -> RejectReason | None:
    if not message.fit_valid:
        return None
    parameters = len(message.parameter_names)
    dimensions = len(message.dimensions)
    if (dimensions != len(message.dimension_names) or dimensions != len(message.dimension_is_bound)
            or parameters**2 != len(message.covariance) or parameters != len(message.standard_deviations)):
        return RejectReason.WRONG_LENGTH
    place, direction = message.pose.pose.position, message.pose.pose.orientation
    return check_finite(place.x, place.y, direction.x, direction.y, direction.z, direction.w, *message.dimensions)


def check_times(message: Contact | ContactShape | Grasp | GraspSides) -> RejectReason | None:
    return check_time(message.header.stamp) or check_duration(message.age)
