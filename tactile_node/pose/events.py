"""What can happen to the contact on one pad, and what it does: the codes and facts of its movement."""

import math
from enum import IntEnum, IntFlag
from typing import NamedTuple


class EventKind(IntEnum):
    """What has happened (ContactEvent.msg mirrors these numbers)."""

    NOT_KNOWN = 0
    MADE = 1     #: the pad was seen empty, and is touched
    LOST = 2     #: it was touched, and is seen empty
    SLIDING = 3  #: the contact has begun to move across the pad
    TURNING = 4  #: it has begun to turn
    HARDER = 5   #: its force has risen by a step
    LIGHTER = 6


class SeenBy(IntEnum):
    """What an event was seen by (ContactEvent.msg mirrors these numbers)."""

    NOT_KNOWN = 0
    OUTLINE = 1             #: the fitted one
    CENTRE_OF_PRESSURE = 2
    ON_OFF = 3              #: outline or centre of on/off taxels
    PRESSURE = 4            #: what is pressed, and how hard


class Moving(IntFlag):
    """What a contact does now (ContactMotion.msg mirrors these numbers)."""

    NOT_KNOWN = 0
    STILL = 1
    SLIDING = 2
    TURNING = 4


class Observable(IntFlag):
    """Which movements of a contact would show (ContactMotion.msg mirrors these numbers)."""

    NOTHING = 0
    ALONG_X = 1
    ALONG_Y = 2
    ROTATION = 4


class Event(NamedTuple):
    """Something that has happened; NaN: not of this kind, or not known."""

    kind: EventKind
    stamp: float  #: acquisition of the frame that showed it [s]
    seen_by: SeenBy
    probability: float
    speed: float = math.nan      #: [m/s]
    direction: float = math.nan  #: in the pad's frame, x to y [rad]
    rate: float = math.nan       #: x to y positive [rad/s]
    force_before: float = math.nan  #: [N]
    force: float = math.nan         #: [N]


class Motion(NamedTuple):
    """What is known of the movement of a contact in one frame."""

    moving: Moving = Moving.NOT_KNOWN
    speed: float = math.nan      #: while SLIDING [m/s]; NaN: not known
    direction: float = math.nan  #: while SLIDING, in the pad's frame, x to y [rad]
    rate: float = math.nan       #: while TURNING, x to y positive [rad/s]
    observable: Observable = Observable.NOTHING
    events: tuple[Event, ...] = ()  #: of this frame
    last_event: Event | None = None  #: since when the pad has been followed
