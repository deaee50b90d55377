"""Close a gripper until both pads are touched or a force limit is reached, and decide when and why to stop.

The callers of this module pass the current time, because the module reads no clock. The module is not a safety function
(ISO 13849, ISO 10218). The module limits only the force that the pads measure, and only after they have measured it.
The gripper continues to close only while the current readings are complete. If the true force may be higher than the
reading, the highest possible force is compared with the limit.
"""

import math
from enum import IntEnum
from typing import NamedTuple

from tactile_node.errors import RefusedGoalError
from tactile_node.grasp.opening import HIGHEST_GAP
from tactile_node.grasp.tracker import GraspContact
from tactile_node.gripper.rules.touch_settings import TouchSettings

BLIND_TIME = 0.5  #: Time for which the gripper waits at rest for complete readings before the goal ends [s].

#: Time without any contact after which a touched object counts as lost [s]. A shorter gap is a bounce.
LOST_AFTER = 0.1
#: Time allowed for the gripper to accept a command and to start moving, in addition to its travel time [s].
START_TIME = 1.0
REST_TIME = 0.3     #: Time without a change of the opening after which the gripper counts as at rest [s].

#: Time allowed for the gripper to come to rest if it is uncertain whether a command has ended [s]. The time allowed for
#: the gripper's answers is added.
REST_LIMIT = 2.0
REST_CHANGE = 2e-4  #: Largest change of the opening at rest [m].

#: A gripper is too slow if it takes more than this many times as long as the commanded speed implies.
SLOWNESS = 3.0
BEYOND = 1e-3  #: Amount by which a commanded opening may be below 0 [m]. Some controllers command slightly less than 0.


class Outcome(IntEnum):
    """Result of a goal. GripperOutcome.msg uses the same numbers."""

    NOT_KNOWN = 0
    REACHED = 1          #: the gripper is at the commanded opening
    TOUCHED = 2          #: both pads are touched
    FORCE_REACHED = 3    #: both pads are touched, and one of them reads the force limit
    STALLED = 4          #: the gripper stalled at its own effort limit
    ONE_SIDED = 5        #: only one pad is touched, and the limit of force or travel is reached
    NOT_SEEN = 6         #: a pad is unseen, or its readings are not current
    FORCE_NOT_KNOWN = 7  #: the force is unknown, because taxels at a contact are saturated, hidden or on/off
    LOST = 8             #: both pads were touched and are empty again
    TOO_SLOW = 9         #: the gripper takes far longer than its speed implies
    CANCELED = 10
    REPLACED = 11         #: a later goal has replaced this one
    REFUSED = 12          #: the goal is invalid
    NO_GRIPPER = 13       #: no server offers the gripper's own action
    GRIPPER_REFUSED = 14  #: the gripper rejected the command
    GRIPPER_FAILED = 15   #: the gripper ended the command without stalling and without reaching the opening
    GRIPPER_SILENT = 16   #: the gripper did not answer
    NOT_STOPPED = 17      #: the gripper did not confirm that it had stopped
    NOT_OPENING = 18      #: the force rises although the gripper should open
    HOLD_ENDED = 19       #: the corrections of the hold have used up the allowed travel
    ALREADY_PRESSED = 20  #: at the start, the pads already read more than the goal's force plus the overshoot
    DUPLICATE = 21        #: another process commands the same gripper or has the same name


#: Outcomes in which the gripper has fulfilled the goal.
SUCCESSES = frozenset((Outcome.REACHED, Outcome.TOUCHED, Outcome.FORCE_REACHED))
#: Outcomes of a command that got no response.
SILENCES = frozenset((Outcome.NO_GRIPPER, Outcome.GRIPPER_SILENT))
#: Outcomes after which the user should check the gripper or its wiring.
FAILURES = SILENCES | {Outcome.NOT_STOPPED, Outcome.NOT_OPENING}
#: Outcomes of a closing goal that are reported even if an unanswered command may still be moving the gripper. Any other
#: outcome is replaced by NOT_STOPPED while such a command remains.
TOLD_IN_DOUBT = SILENCES | {Outcome.GRIPPER_REFUSED, Outcome.REFUSED, Outcome.REPLACED, Outcome.DUPLICATE}


class ForceReading(NamedTuple):
    """The force that one pad reads."""

    force: float = math.nan  #: total force of all contacts on the pad [N], or NaN if unknown
    is_bound: bool = False   #: True if the contact continues beyond the pad, so that the force is a lower bound

    #: True if taxels at the contact are saturated or hidden, so that the force may have any value
    is_hidden: bool = False


class TouchReading(NamedTuple):
    """The readings of both pads at one acquisition."""

    acquired: float  #: acquisition time [s], or -inf if unknown
    fresh: bool
    contact: GraspContact
    pads: tuple[ForceReading, ForceReading]
    force_sd: float = math.nan  #: largest standard deviation of a pad's force [N], or NaN if unknown

    #: direction in which the contact slides on each pad, in the frame of that pad [rad], or NaN if no slide is known
    slides: tuple[float, float] = (math.nan, math.nan)
    is_whole: bool = True  #: True if all fields come from the same frame

    @property
    def is_touched(self) -> bool:
        return self.contact in (GraspContact.ONE_SIDED, GraspContact.TWO_SIDED)

    @property
    def strongest(self) -> float:
        """Larger of the forces that the two pads read [N], or NaN if no force is known."""
        return max((pad.force for pad in self.pads if math.isfinite(pad.force)), default=math.nan)

    @property
    def weakest(self) -> float:
        """Smaller of the forces that the two pads read [N]."""
        return min(pad.force for pad in self.pads)

    @property
    def has_force(self) -> bool:
        """True if the force of each contact is known or is a bound."""
        return not (self.is_touched and any(pad.is_hidden or math.isnan(pad.force) for pad in self.pads))

    def most(self, edge_share: float) -> float:
        """Return the highest force that may act on either pad [N].

        If the contact continues beyond a pad, the pad may read only ``edge_share`` of the force.
        """
        return max(pad.force / (edge_share if pad.is_bound else 1.0) for pad in self.pads)

    @property
    def is_seen(self) -> bool:
        return self.fresh and self.contact not in (GraspContact.NOT_KNOWN, GraspContact.UNSEEN)

    def is_current(self, now: float, max_age: float) -> bool:
        """Return True if both pads were seen at most ``max_age`` [s] before ``now`` [s]."""
        return self.is_seen and now - self.acquired <= max_age

    def after(self, before: 'TouchReading') -> 'TouchReading':
        """Return these readings if both pads are seen, or else the readings ``before``.

        A single lost CAN frame must not make the gripper blind. If a pad is unseen, the readings ``before`` keep their
        own time, but any force that a pad reads now replaces that pad's old force.
        """
        if self.is_seen:
            return self
        left, right = (old if math.isnan(new.force) else new for new, old in zip(self.pads, before.pads))
        return before._replace(pads=(left, right), is_whole=False)


NO_TOUCH = TouchReading(-math.inf, False, GraspContact.NOT_KNOWN, (ForceReading(), ForceReading()))


class Goal(NamedTuple):
    """A client's request to move the gripper."""

    opening: float  #: [m]
    speed: float  #: speed at which the opening changes until the first touch [m/s]
    slow_speed: float  #: speed after the first touch [m/s]
    force: float  #: limit for the larger of the two pad forces [N]
    until_touched: bool  #: True if the client gave no force, so that the gripper stops when both pads are touched


def make_goal(opening: float, speed: float, force: float, limits: TouchSettings, *,
              speed_is_fixed: bool = False) -> Goal:
    """Return a goal that closes the gripper to an opening.

    Parameters
    ----------
    opening : float
        Opening [m].
    speed : float
        Speed until the first touch [m/s], or 0 if none is given.
    force : float
        Limit for the larger of the two pad forces [N], or 0 if none is given.
    limits : TouchSettings
        Limits for closing the gripper.
    speed_is_fixed : bool
        True if the gripper does not accept a speed and closes at ``limits.fast_speed``.

    Raises
    ------
    RefusedGoalError
        Raised if a number is out of range, or if the overshoot at the speed exceeds the force.

    Examples
    --------
    >>> make_goal(0.0, 0.0, 0.6, TouchSettings(latency=0.06, stiffness=1000.0)).speed
    0.01
    """
    check_number('opening', opening, -BEYOND, HIGHEST_GAP, 'm')
    check_number('velocity', speed, 0.0, math.inf, 'm/s')
    check_number('effort', force, 0.0, limits.highest_force, 'N')
    limit = force or limits.touch_force
    fast = limits.fast_speed if speed_is_fixed else speed or min(limits.fast_speed, limits.fastest(limit))
    if fast > limits.fastest(limit):
        raise RefusedGoalError(
            'velocity', expected=f'at most {limits.fastest(limit):.3g} m/s for a force of {limit:g} N',
            got=f'{fast:g} m/s: latency x speed x stiffness = {limits.overshoot(fast):.3g} N',
            remedy='Close more slowly, or allow more force.')
    return Goal(opening, fast, fast if speed_is_fixed else min(limits.slow_speed, fast), limit, not force)


def check_number(name: str, value: float, low: float, high: float, unit: str) -> None:
    """Raise RefusedGoalError unless ``value`` is a finite number from ``low`` to ``high``."""
    if not low <= value <= high or math.isinf(value):
        raise RefusedGoalError(name, expected=f'{low:g} to {high:g} {unit}', got=f'{value:g} {unit}',
                               remedy='Correct the goal, or the parameters of the gripper node.')


class Closing:
    """A goal to close the gripper, and its progress since the start.

    Parameters
    ----------
    goal : Goal
        The goal.
    limits : TouchSettings
        Limits for closing the gripper.
    now : float
        Time of the start [s].
    opening : float
        Opening at the start [m], or NaN if unknown.
    """

    def __init__(self, goal: Goal, limits: TouchSettings, now: float, opening: float):
        self.goal, self._limits = goal, limits
        self.target = goal.opening  #: opening to which the gripper closes [m]
        self._opening, self._looked = opening, now
        self._has_begun = False    # True once the gripper has been commanded to move
        self._was_held = False     # True once both pads have been touched
        self._seen = now           # time at which the readings were last complete
        self._waits = False        # True while the gripper rests because the readings are incomplete
        self._seen_touched = now   # time at which a contact was last seen
        self._one_sided: float | None = None  # travel with only one pad touched [m]; None otherwise
        self._pace = goal.slow_speed if self._is_narrow() else goal.speed  # speed unless the gripper waits [m/s]
        self._deadline = self._deadline_at(now)

    @property
    def speed(self) -> float:
        """Speed at which the gripper continues [m/s]; 0 while it waits at rest."""
        return 0.0 if self._waits else self._pace

    def look(self, now: float, touch: TouchReading, opening: float, *, is_still: bool = True) -> Outcome | None:
        """Return the outcome that ends the goal, or None to continue at ``speed``.

        A late or incomplete frame does not end a goal. Until the readings are complete again, the gripper waits at
        rest.

        Parameters
        ----------
        now : float
            Time [s].
        touch : TouchReading
            Latest readings of the pads.
        opening : float
            Current opening [m], or NaN if unknown.
        is_still : bool
            True if the gripper has stopped after a stop command.
        """
        if self._waits:
            self._deadline += now - self._looked
        travel, blind = self._travel(now, opening), self._why_blind(now, touch)
        if blind is None:
            self._seen = now
        self._waits = blind is not None or (self._waits and not is_still)
        if self._waits:
            self._seen_touched = now
            return blind if now - self._seen > BLIND_TIME else None
        self._follow(now, touch, travel)
        stop = self._why_stop(now, touch) if self._has_begun or not self._is_pressed(touch) else Outcome.ALREADY_PRESSED
        self._has_begun = True
        if stop is None and self._pace > self.goal.slow_speed and (touch.is_touched or self._is_narrow()):
            self._pace = self.goal.slow_speed
            self._deadline = self._deadline_at(now)
        return stop

    def _why_blind(self, now: float, touch: TouchReading) -> Outcome | None:
        if not touch.is_current(now, self._limits.max_age):
            return Outcome.NOT_SEEN
        is_enough = touch.contact is GraspContact.TWO_SIDED and self.goal.until_touched
        return None if touch.has_force or is_enough else Outcome.FORCE_NOT_KNOWN

    def _is_pressed(self, touch: TouchReading) -> bool:
        most = self.goal.force + self._limits.overshoot(self.goal.speed)
        return touch.has_force and touch.most(self._limits.edge_share) > most

    def _why_stop(self, now: float, touch: TouchReading) -> Outcome | None:
        is_held = touch.contact is GraspContact.TWO_SIDED
        if touch.has_force and touch.most(self._limits.edge_share) >= self.goal.force:
            return Outcome.FORCE_REACHED if is_held else Outcome.ONE_SIDED
        if is_held and self.goal.until_touched:
            return Outcome.TOUCHED
        if self._one_sided is not None and self._one_sided >= self._limits.one_sided_travel:
            return Outcome.ONE_SIDED
        if self._was_held and now - self._seen_touched > LOST_AFTER:
            return Outcome.LOST
        return Outcome.TOO_SLOW if now > self._deadline else None

    def _follow(self, now: float, touch: TouchReading, travel: float) -> None:
        self._was_held |= touch.contact is GraspContact.TWO_SIDED
        if touch.is_touched:
            self._seen_touched = now
        if touch.contact is GraspContact.ONE_SIDED:
            self._one_sided = 0.0 if self._one_sided is None else self._one_sided + travel
        elif touch.contact is GraspContact.TWO_SIDED:
            self._one_sided = None

    def _travel(self, now: float, opening: float) -> float:
        """Return how far the gripper has closed since the last call of `look` [m].

        If the opening is unknown, the travel is computed from the commanded speed.
        """
        is_known = math.isfinite(opening) and math.isfinite(self._opening)
        travel = self._opening - opening if is_known else self.speed * (now - self._looked)
        self._opening, self._looked = opening, now
        return travel

    def _is_narrow(self) -> bool:
        # An unknown opening counts as narrow.
        return self._limits.slow_from > 0 and not self._opening > self._limits.slow_from

    def _deadline_at(self, now: float) -> float:
        opening = self._opening if math.isfinite(self._opening) else self._limits.widest
        return deadline(now, opening - self.goal.opening, self._pace)


class Widening:
    """A goal to open the gripper, even without readings from the pads.

    If the pads read a rising force, the goal ends.

    Parameters
    ----------
    goal : float
        Opening to reach [m].
    limits : TouchSettings
        Limits for closing the gripper.
    now : float
        Time of the start [s].
    opening : float
        Opening at the start [m], or NaN if unknown.
    """

    def __init__(self, goal: float, limits: TouchSettings, now: float, opening: float):
        self.target, self._limits = goal, limits
        self._force = math.nan  # larger of the pad forces at the first current reading [N]
        self._deadline = deadline(now, goal - (opening if math.isfinite(opening) else 0.0), self.speed)

    @property
    def speed(self) -> float:
        """Speed at which the gripper opens [m/s]."""
        return self._limits.fast_speed

    def look(self, now: float, touch: TouchReading, opening: float, *, is_still: bool = True) -> Outcome | None:
        """Return the outcome that ends the goal, or None to continue.

        The parameters are those of `Closing.look`.
        """
        if touch.is_current(now, self._limits.max_age):
            self._force = touch.strongest if math.isnan(self._force) else self._force
            if touch.strongest > self._force + self._limits.touch_force:
                return Outcome.NOT_OPENING
        return Outcome.TOO_SLOW if now > self._deadline else None


class Rest:
    """Checks whether the opening has stayed the same for REST_TIME, starting at ``now`` [s]."""

    def __init__(self, now: float):
        self._since, self._opening = now, math.nan

    def look(self, now: float, opening: float) -> bool:
        """Return True if the gripper is at rest.

        An unknown ``opening`` (NaN) [m] counts as unchanged.
        """
        if math.isfinite(opening) and not abs(opening - self._opening) <= REST_CHANGE:
            self._since, self._opening = now, opening
        return now - self._since >= REST_TIME


class Clearing:
    """Waits until the gripper has answered and is at rest, if it is uncertain whether a command has ended.

    A new goal closes the gripper only after this wait.

    A gripper that refuses a cancel request and never ends the command counts as at rest only if its opening is
    measured.

    Parameters
    ----------
    now : float
        Time of the start [s].
    timeout : float
        Time allowed for the gripper to answer the cancel requests [s].
    """

    def __init__(self, now: float, timeout: float):
        self._limit = now + timeout
        self._rest: Rest | None = None  # the rest is checked once the gripper has answered
        self.is_over = False

    def look(self, now: float, opening: float, *, is_answered: bool, is_ended: bool) -> Outcome | None:
        """Return the reason why the goal cannot close the gripper, or None to continue.

        Parameters
        ----------
        now : float
            Time [s].
        opening : float
            Current opening [m], or NaN if unknown.
        is_answered : bool
            True if the gripper has answered each cancel request.
        is_ended : bool
            True if the gripper's answers confirm that each command has ended.
        """
        if self._rest is None and is_answered:
            self._rest = Rest(now)
        if self._rest is None:
            return Outcome.GRIPPER_SILENT if now > self._limit else None
        is_at_rest = self._rest.look(now, opening)
        self.is_over = is_at_rest and is_answered and (is_ended or math.isfinite(opening))
        return Outcome.NOT_STOPPED if not self.is_over and now > self._limit + REST_LIMIT else None


def deadline(now: float, travel: float, speed: float) -> float:
    """Return the time after which a gripper is too slow [s].

    Parameters
    ----------
    now : float
        Time at which the gripper starts to move [s].
    travel : float
        Travel [m].
    speed : float
        Commanded speed [m/s].
    """
    return now + START_TIME + SLOWNESS * max(travel, 0.0) / speed
