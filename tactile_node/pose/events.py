"""Codes and records that describe the movement of a contact on one pad."""

import math
from enum import IntEnum, IntFlag
from typing import NamedTuple


class EventKind(IntEnum):
    """Kind of event. ContactEvent.msg uses the same numbers."""

    NOT_KNOWN = 0
    MADE = 1     #: the pad was seen empty and is now touched
    LOST = 2     #: the pad was touched and is now seen empty
    SLIDING = 3  #: the contact has moved farther across the pad than a load along the pad can shift it
    TURNING = 4  #: the contact has begun to turn
    HARDER = 5   #: the force has risen by a step
    LIGHTER = 6  #: the force has fallen by a step
    SHIFTED = 7   #: the contact has stopped at another place, no farther away than a load along the pad can shift it
    RETURNED = 8  #: the contact has stopped where its shift began, or at its position of rest


class SeenBy(IntEnum):
    """Quantity in which an event was detected. ContactEvent.msg uses the same numbers."""

    NOT_KNOWN = 0
    OUTLINE = 1  #: the fitted outline
    CENTRE_OF_PRESSURE = 2
    ON_OFF = 3    #: outline or centre of a contact on on/off taxels
    PRESSURE = 4  #: the pressed taxels and their pressures


class Moving(IntFlag):
    """Current movement of a contact. ContactMotion.msg uses the same numbers."""

    NOT_KNOWN = 0
    STILL = 1
    SLIDING = 2
    TURNING = 4
    SHIFTING = 8


class Observable(IntFlag):
    """Movements of a contact that would be detected if they occurred. ContactMotion.msg uses the same numbers."""

    NOTHING = 0
    ALONG_X = 1
    ALONG_Y = 2
    ROTATION = 4


class Event(NamedTuple):
    """A change in the state of a contact.

    A quantity is NaN if it is unknown or does not belong to this kind of event.
    """

    kind: EventKind
    stamp: float  #: acquisition time of the frame that showed the event [s]
    seen_by: SeenBy
    probability: float
    speed: float = math.nan         #: [m/s]
    direction: float = math.nan     #: in the pad frame, positive from x to y [rad]
    rate: float = math.nan          #: positive from x to y [rad/s]
    force_before: float = math.nan  #: [N]
    force: float = math.nan         #: [N]


class Motion(NamedTuple):
    """The movement of a contact at the time of one frame."""

    moving: Moving = Moving.NOT_KNOWN
    speed: float = math.nan      #: speed while SHIFTING or SLIDING [m/s]; NaN if the speed is unknown
    direction: float = math.nan  #: direction of this movement, in the pad frame, positive from x to y [rad]
    rate: float = math.nan       #: angular velocity while TURNING, positive from x to y [rad/s]
    observable: Observable = Observable.NOTHING
    events: tuple[Event, ...] = ()   #: events of this frame
    last_event: Event | None = None  #: latest event since tracking of the pad began
