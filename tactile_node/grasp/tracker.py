"""Combine the results of two opposing pads into one grasp, with its alignment and the time for which it has held.

An unknown side is never reported as EMPTY. A side is UNSEEN if it has no current result or if its pad is not seen.
"""

import math
from collections import deque
from dataclasses import dataclass
from enum import IntEnum
from statistics import median
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError, InputError
from tactile_node.grasp.gripper import Gripper, Line, Point, contact_line
from tactile_node.grasp.steadiness import Steadiness, SteadinessSettings
from tactile_node.shape.recognition import Shape

SIDES = ('left', 'right')
# A side is silent after SILENT_PERIODS periods without a result, but not before SHORTEST_SILENCE has passed. Planners
# must learn of a silence within 3 periods, or within 0.1 s if that is longer. The limits leave time for the message.
SILENT_PERIODS = 2.25
SHORTEST_SILENCE = 0.075  #: [s]
# The hold restarts after a gap of more than GAP_PERIODS periods between two acquisitions, but not after a gap of less
# than SHORTEST_GAP.
GAP_PERIODS = 3
SHORTEST_GAP = 0.1  #: [s]
PERIODS_KEPT = 15    #: Number of latest periods whose median is taken as the period of a side.


class SideState(IntEnum):
    """State of a pad. Grasp.msg uses the same numbers."""

    NOT_KNOWN = 0  #: no result yet
    UNSEEN = 1     #: hidden taxels could hold a contact, or the latest result is too old
    EMPTY = 2      #: the pad is seen, and nothing touches it
    TOUCHED = 3


class SideResult(NamedTuple):
    """The result of one pad for one acquisition."""

    time: float  #: acquisition time on this computer's clock [s]; -inf if the age of the result is unknown
    state: SideState  #: state as reported by the pad
    class_name: str = Shape.NONE.value  #: name of the shape
    centre: tuple[float, float] | None = None  #: centre of the contact in the pad frame [m], or None if unknown
    resolution: float = 0.0002  #: error of a moving contact's centre, apart from noise [m]
    is_bound: bool = False  #: True if the contact may extend beyond the seen area, so that its true centre may differ

    #: True if the contact could creep while its centre stays, because much of the contact is unseen
    hides_creep: bool = False
    moves: bool = False  #: True if the contact is seen to slide, to shift or to turn


class GraspContact(IntEnum):
    """Contact state of both pads. Grasp.msg uses the same numbers."""

    NOT_KNOWN = 0   #: a side has no result yet
    UNSEEN = 1      #: a side is not seen
    NO_CONTACT = 2  #: nothing touches either side, and both are seen
    ONE_SIDED = 3   #: only one side is touched, and both are seen
    TWO_SIDED = 4

    @classmethod
    def of(cls, states: tuple[SideState, SideState]) -> 'GraspContact':
        """Return the state of contact from the states of both sides.

        >>> GraspContact.of((SideState.TOUCHED, SideState.UNSEEN)).name
        'UNSEEN'
        """
        if SideState.NOT_KNOWN in states:
            return cls.NOT_KNOWN
        if SideState.UNSEEN in states:
            return cls.UNSEEN
        return cls(cls.NO_CONTACT + states.count(SideState.TOUCHED))


class GraspState(NamedTuple):
    """State of both pads at one time."""

    side_states: tuple[SideState, SideState]  #: left, right
    contact: GraspContact
    fresh: bool        #: True if both sides are current and were acquired at nearly the same time
    same_shape: bool   #: True if both sides are touched and report the same known shape
    line: Line | None  #: line of a fresh TWO_SIDED contact with two known centres, or None
    line_is_bound: bool
    held: float  #: time for which the shapes and centres on both sides have stayed the same [s]

    #: True if the grasp is two-sided and fresh, has held long enough, and neither contact creeps or moves
    stable: bool
    creep: float  #: speed of the faster centre [m/s], or NaN if unknown


@dataclass(frozen=True)
class GraspSettings:
    """Limits that decide when a result is current and when a grasp is stable."""

    gripper: Gripper = Gripper()
    steadiness: SteadinessSettings = SteadinessSettings()
    min_hold: float = 0.2  #: shortest time for which a grasp must hold to be stable [s]
    max_skew: float = 0.1  #: largest time between the acquisitions of the two sides [s]
    max_age: float = 0.25  #: largest age of a result [s]

    def __post_init__(self) -> None:
        if not (0 < self.max_skew < np.inf and 0 < self.max_age < np.inf and 0 <= self.min_hold):
            raise ConfigurationError('grasp settings', expected='max_skew and max_age > 0, min_hold >= 0',
                                     got=str(self), remedy='Give seconds.')


class GraspTracker:
    """Follows a grasp from the results of both sides, which may arrive in any order.

    The tracker reads no clock; its callers pass the time of a clock that never goes backwards.
    """

    def __init__(self, settings: GraspSettings = GraspSettings()):
        self._settings = settings
        self._sides = {side: _Side(settings) for side in SIDES}

    def update(self, side: str, result: SideResult, now: float) -> None:
        """Add the result of a side.

        Parameters
        ----------
        side : str
            "left" or "right".
        result : SideResult
            Result of this side.
        now : float
            Time at which the result was received [s].

        Raises
        ------
        ConfigurationError
            Raised if ``side`` is neither "left" nor "right".
        InputError
            Raised if a time or a centre is not finite.
        """
        if side not in SIDES:
            raise ConfigurationError('side of a grasp', expected=' or '.join(SIDES), got=repr(side),
                                     remedy='Name each pad by its side of the gripper.')
        if not (all(map(math.isfinite, (now, *(result.centre or ())))) and result.time < np.inf):
            raise InputError('result of a side', expected='a finite time and centre',
                             got=f'{result.time}, {now}, {result.centre}',
                             remedy='Pass None for an unknown centre, and -inf as the time if the age is unknown.')
        self._sides[side].update(result, now)

    def silence_limit(self, side: str) -> float:
        """Return the time without a result after which ``side`` is no longer current [s]."""
        return self._sides[side].silence_limit

    def state(self, now: float, gap: float = np.nan) -> GraspState:
        """Return the state of the grasp at ``now`` [s], with an opening of ``gap`` [m]."""
        left, right = (self._sides[side] for side in SIDES)
        states = left.state(now), right.state(now)
        contact = GraspContact.of(states)
        fresh = (left.is_current(now) and right.is_current(now)
                 and abs(left.latest.time - right.latest.time) <= self._settings.max_skew)
        state = GraspState(
            side_states=states, contact=contact, fresh=fresh, same_shape=_is_same_shape(states, left, right), line=None,
            line_is_bound=False, held=0.0, stable=False, creep=np.nan)
        if contact is not GraspContact.TWO_SIDED or not fresh:
            return state
        held = min(left.held, right.held)
        is_bound = left.latest.is_bound or right.latest.is_bound
        return state._replace(
            line=self._line(left.latest.centre, right.latest.centre, gap), line_is_bound=is_bound, held=held,
            creep=float(np.maximum(left.creep, right.creep)),
            stable=left.rests and right.rests and held >= self._settings.min_hold)

    def _line(self, left: Point | None, right: Point | None, gap: float) -> Line | None:
        return None if left is None or right is None else contact_line(self._settings.gripper, left, right, gap)


def _is_same_shape(states: tuple[SideState, SideState], left: '_Side', right: '_Side') -> bool:
    name = left.latest.class_name
    is_known = name not in (Shape.NONE.value, Shape.UNKNOWN.value)
    return states == (SideState.TOUCHED, SideState.TOUCHED) and is_known and name == right.latest.class_name


class _Side:
    """The latest result of one pad, the period of its results, and the time at which its current hold began."""

    def __init__(self, settings: GraspSettings):
        self._settings = settings
        self.latest = SideResult(-np.inf, SideState.NOT_KNOWN)
        self._received = -np.inf
        self._gaps: deque[float] = deque(maxlen=PERIODS_KEPT)
        self._period = 0.0  # median of the gaps [s]; 0 before the first gap
        self._steadiness = Steadiness(settings.steadiness)
        self._touch: SideResult | None = None  # latest result for this contact that includes a centre
        self.rests = False  #: True if the latest result shows that the centre rests

    @property
    def silence_limit(self) -> float:
        return self._time_of(SILENT_PERIODS, SHORTEST_SILENCE)

    def _time_of(self, periods: float, shortest: float) -> float:
        """Return the duration of this many ``periods`` of the side, but at least ``shortest`` [s]."""
        return max(shortest, periods * self._period)

    @property
    def _is_followed(self) -> bool:
        return self._touch is self.latest

    @property
    def held(self) -> float:
        """Time for which the shape and the centre have held [s], or 0 if there is no hold."""
        return max(0.0, self.latest.time - self._steadiness.since) if self._is_followed else 0.0

    @property
    def creep(self) -> float:
        """Speed of the centre [m/s], or NaN if unknown."""
        speed = self._steadiness.speed
        return speed.value if speed and self._is_followed else np.nan

    def is_current(self, now: float) -> bool:
        return now - self.latest.time <= self._settings.max_age and now - self._received < self.silence_limit

    def state(self, now: float) -> SideState:
        if self._received == -np.inf:
            return SideState.NOT_KNOWN
        return self.latest.state if self.is_current(now) else SideState.UNSEEN

    def update(self, result: SideResult, now: float) -> None:
        gap = result.time - self.latest.time
        if 0 < gap <= self._settings.max_age:  # a longer gap is an outage, because the side was unseen meanwhile
            self._gaps.append(gap)
            self._period = median(self._gaps)
        self.latest = result
        self._received = now
        self.rests = False
        if result.state is SideState.EMPTY:
            self._touch = None
        elif result.state is SideState.TOUCHED and math.isfinite(result.time) and not result.hides_creep:
            self._follow(result)

    def _follow(self, result: SideResult) -> None:
        """Follow the contact. A change of shape or a gap restarts the hold, but a single hidden frame does not.

        A contact that reaches the edge of the pad may hide its creep. For example, a bar across the whole pad hides its
        creep when the bar slides along its own length.
        """
        if result.centre is None:
            return
        before = self._touch
        if (before is None or result.class_name != before.class_name
                or abs(result.time - before.time) > self._time_of(GAP_PERIODS, SHORTEST_GAP)):
            self._steadiness.restart()
        self._touch = result
        self.rests = self._steadiness.update(result.time, result.centre, result.resolution) and not result.moves
