"""Convert motions and events of a contact to messages, and check such messages before use."""

import math

from builtin_interfaces.msg import Duration
from std_msgs.msg import Header

from tactile_node.pose.events import Event, EventKind, Motion, Moving, Observable, SeenBy
from tactile_node.ros.contact_messages import single
from tactile_node.ros.message_age import age_message, age_seconds
from tactile_node.skin.taxel_array import RejectReason, check_duration, check_time
from tactile_skin.msg import ContactEvent, ContactMotion

ACROSS = Moving.SHIFTING | Moving.SLIDING  #: Flags of a movement across the pad, of which at most one is set.
ANY_MOVEMENT = int(ACROSS | Moving.TURNING)
MOST_OBSERVABLE = sum(Observable)


def motion_message(motion: Motion, stamp: float) -> ContactMotion:
    """Return a motion as a message. The age of the last event is relative to the frame's ``stamp`` [s]."""
    event = motion.last_event
    return ContactMotion(
        moving=int(motion.moving), speed=single(motion.speed), direction=single(motion.direction),
        rate=single(motion.rate), observable=int(motion.observable), last_event=int(event.kind) if event else 0,
        last_event_age=age_message(max(0.0, stamp - event.stamp) if event else math.inf))


def current_motion(motion: ContactMotion, age: float, is_current: bool) -> ContactMotion:
    """Return ``motion`` with ``age`` [s] added to its last event, or an unknown motion if ``is_current`` is false."""
    if not is_current:
        return motion_message(Motion(), 0.0)
    return ContactMotion(
        moving=motion.moving, speed=motion.speed, direction=motion.direction, rate=motion.rate,
        observable=motion.observable, last_event=motion.last_event,
        last_event_age=age_message(age_seconds(motion.last_event_age) + age))


def is_moving(motion: ContactMotion) -> bool:
    """Return True if the contact shifts, slides or turns."""
    return bool(motion.moving & ANY_MOVEMENT)


def event_message(event: Event, header: Header, sequence: int, age: Duration) -> ContactEvent:
    """Return an event as a message with the ``header`` and ``sequence`` of the frame that showed the event."""
    return ContactEvent(
        header=header, sequence=sequence, age=age, kind=int(event.kind), seen_by=int(event.seen_by),
        probability=single(event.probability), speed=single(event.speed), direction=single(event.direction),
        rate=single(event.rate), force_before=event.force_before, force=event.force)


def check_motion(message: ContactMotion) -> RejectReason | None:
    """Check the codes. Only a shifting or sliding contact may have a speed, and only a turning contact a rate."""
    is_contradictory = (message.moving & Moving.STILL and message.moving != Moving.STILL
                        or message.moving & ACROSS == ACROSS)
    if (is_contradictory or message.moving > sum(Moving) or message.observable > MOST_OBSERVABLE
            or message.last_event > max(EventKind)):
        return RejectReason.UNKNOWN_CODE
    of_slide, of_turn = (message.speed, message.direction), (message.rate,)
    if any(map(math.isinf, (*of_slide, *of_turn))):
        return RejectReason.NOT_FINITE
    for state, values in ((ACROSS, of_slide), (Moving.TURNING, of_turn)):
        if not message.moving & state and any(value and not math.isnan(value) for value in values):
            return RejectReason.INCONSISTENT
    return RejectReason.INCONSISTENT if message.speed < 0 else check_duration(message.last_event_age)


def check_contact_event(message: ContactEvent) -> RejectReason | None:
    """Check the codes, times and numbers of an event. A default-constructed message is not a valid event."""
    if not (0 < message.kind <= max(EventKind) and 0 < message.seen_by <= max(SeenBy)):
        return RejectReason.UNKNOWN_CODE
    values = message.speed, message.direction, message.rate, message.force_before, message.force
    if any(map(math.isinf, values)) or not math.isfinite(message.probability):
        return RejectReason.NOT_FINITE
    if not 0 <= message.probability <= 1:
        return RejectReason.WRONG_PROBABILITIES
    if message.speed < 0:
        return RejectReason.INCONSISTENT
    return check_time(message.header.stamp) or check_duration(message.age)
