"""Closing a gripper until its pads are touched or a force is reached: how fast to go on, and when to stop and why.

Pure: time is what it is given. No safety function (ISO 13849, ISO 10218): it limits what it sees, when it sees it.
Rule: it goes on only by what is seen, current and whole. What may be more than it reads counts as more.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from tactile_node.errors import ConfigurationError, RefusedGoalError
from tactile_node.grasp.opening import HIGHEST_GAP
from tactile_node.grasp.tracker import GraspContact

BLIND_TIME = 0.5   #: s for which it stops and waits to see again, before the goal ends
LOST_AFTER = 0.1   #: s without any contact, after both pads were touched: shorter ones are bounces
START_TIME = 1.0   #: s that a gripper may take beyond its travel, to accept a command and to begin
REST_TIME = 0.3    #: s without a change of the opening, after which the gripper is at rest
REST_LIMIT = 2.0   #: s within which it must be at rest to close after a command in doubt, once it has answered
REST_CHANGE = 2e-4  #: m, of the opening at rest
SLOWNESS = 3.0     #: times the time that the commanded speed needs, after which it is too slow
BEYOND = 1e-3      #: m by which a commanded opening may be below 0: controllers close a little more than fully


class Outcome(IntEnum):
    """How a goal ended (GripperOutcome.msg mirrors these numbers)."""

    NOT_KNOWN = 0
    REACHED = 1           #: the gripper is at the commanded opening
    TOUCHED = 2           #: both pads are touched
    FORCE_REACHED = 3     #: the stronger pad reads the limit, and both are touched
    STALLED = 4           #: the gripper stalled by its own limit of effort
    ONE_SIDED = 5         #: one pad is touched, up to the limit of force or of travel
    NOT_SEEN = 6          #: a pad is unseen, or what is known of it is not current
    FORCE_NOT_KNOWN = 7   #: saturated, hidden or on/off taxels at a contact: its force may be any
    LOST = 8              #: both pads were touched, and are empty again
    TOO_SLOW = 9          #: the gripper takes far longer than its speed explains
    CANCELED = 10
    REPLACED = 11         #: by a later goal
    REFUSED = 12          #: the goal cannot be used
    NO_GRIPPER = 13       #: nothing serves the gripper's own action
    GRIPPER_REFUSED = 14  #: the gripper rejected the command
    GRIPPER_FAILED = 15   #: the gripper ended the command, neither stalled nor there
    GRIPPER_SILENT = 16   #: the gripper did not answer
    NOT_STOPPED = 17      #: the gripper did not confirm that it stopped
    NOT_OPENING = 18      #: the force rises while it should open
    HOLD_ENDED = 19       #: the travel of the hold is used
    ALREADY_PRESSED = 20  #: the pads read more than the goal's force and overshoot before anything moved
    DUPLICATE = 21        #: another process commands the same gripper, or has the same name


#: The gripper does what the goal asked for.
SUCCESSES = frozenset((Outcome.REACHED, Outcome.TOUCHED, Outcome.FORCE_REACHED))


class PadForce(NamedTuple):
    """What one pad reads."""

    force: float = math.nan       #: of all its contacts [N]; NaN: not known
    is_bound: bool = False        #: the contact goes on beyond the pad: it is at least this
    is_hidden: bool = False       #: taxels at the contact are saturated or hidden: it may be any


class Touch(NamedTuple):
    """What a grasp says, at the time of its acquisition."""

    acquired: float               #: [s]; -inf: not known
    fresh: bool
    contact: GraspContact
    pads: tuple[PadForce, PadForce]
    force_sd: float = math.nan    #: standard deviation of either pad's force, at most [N]; NaN: not known
    #: direction in which the contact on each pad slides, in its own frame [rad]; NaN: it does not, or not known
    slides: tuple[float, float] = (math.nan, math.nan)
    is_whole: bool = True         #: all of it was seen at once

    @property
    def is_touched(self) -> bool:
        return self.contact in (GraspContact.ONE_SIDED, GraspContact.TWO_SIDED)

    @property
    def strongest(self) -> float:
        """Force that the stronger pad reads [N]; NaN: not known."""
        return max((pad.force for pad in self.pads if math.isfinite(pad.force)), default=math.nan)

    @property
    def weakest(self) -> float:
        """Force that the weaker pad reads [N]."""
        return min(pad.force for pad in self.pads)

    @property
    def has_force(self) -> bool:
        """Whether the force of each contact is known, or is a bound."""
        return not (self.is_touched and any(pad.is_hidden or math.isnan(pad.force) for pad in self.pads))

    def most(self, edge_share: float) -> float:
        """Return the force of the stronger pad, of a contact that goes on beyond it the most that it may be [N]."""
        return max(pad.force / (edge_share if pad.is_bound else 1.0) for pad in self.pads)

    @property
    def is_seen(self) -> bool:
        return self.fresh and self.contact not in (GraspContact.NOT_KNOWN, GraspContact.UNSEEN)

    def is_current(self, now: float, max_age: float) -> bool:
        """Whether both pads were seen, at most ``max_age`` before ``now`` [s]."""
        return self.is_seen and now - self.acquired <= max_age

    def after(self, before: 'Touch') -> 'Touch':
        """Return what is known with what was seen ``before``: one frame with a lost CAN frame is no blindness.

        It is as old as what was seen; a force that one pad alone reads now counts.
        """
        if self.is_seen:
            return self
        left, right = (old if math.isnan(new.force) else new for new, old in zip(self.pads, before.pads))
        return before._replace(pads=(left, right), is_whole=False)


NO_TOUCH = Touch(-math.inf, False, GraspContact.NOT_KNOWN, (PadForce(), PadForce()))


@dataclass(frozen=True)
class TouchLimits:
    """Limits of closing. Raises ConfigurationError for those out of range, and for speeds that exceed the force."""

    widest: float = 0.08            #: opening of the gripper when it is open [m]
    fast_speed: float = 0.02        #: of the opening, until the first touch [m/s]
    slow_speed: float = 0.005       #: from then on, or from an opening of slow_from on [m/s]
    slow_from: float = 0.0          #: [m]
    touch_force: float = 2.0        #: of the stronger pad, where a goal gives none [N]
    highest_force: float = 20.0     #: that a goal may give [N]
    edge_share: float = 0.5         #: of its force that a pad reads of a contact that goes on beyond it
    one_sided_travel: float = 0.02  #: for which it goes on with one pad touched [m]; 0: it stops at once
    max_age: float = 0.15           #: of what is seen [s]
    latency: float = 0.06           #: from a touch until the gripper stops [s]
    stiffness: float = 1000.0       #: of pads and object: force for a metre of the opening [N/m]

    def __post_init__(self) -> None:
        positive = (self.widest, self.fast_speed, self.slow_speed, self.touch_force, self.highest_force,
                    self.edge_share, self.max_age, self.latency, self.stiffness)
        if not (all(0 < each < math.inf for each in positive) and self.edge_share <= 1
                and self.slow_speed <= self.fast_speed and self.touch_force <= self.highest_force
                and 0 <= self.slow_from < math.inf and 0 <= self.one_sided_travel < math.inf):
            raise ConfigurationError(
                'limits of closing', expected='numbers above 0, edge_share <= 1, slow_speed <= fast_speed, '
                'touch_force <= highest_force', got=str(self), remedy='Correct the parameters of the gripper node.')
        if self.overshoot(self.fast_speed) > self.touch_force:
            raise ConfigurationError(
                'fast_speed', expected=f'at most {self.fastest(self.touch_force):.3g} m/s, at which latency x speed x '
                f'stiffness is the touch_force of {self.touch_force:g} N',
                got=f'{self.fast_speed:g} m/s: {self.latency:g} s x {self.fast_speed:g} m/s x {self.stiffness:g} N/m '
                f'= {self.overshoot(self.fast_speed):.3g} N', remedy='Close slower, or allow more force.')

    def overshoot(self, speed: float) -> float:
        """Return the force that is added from a touch until the gripper stops [N]."""
        return self.latency * speed * self.stiffness

    def fastest(self, force: float) -> float:
        """Return the speed at which the overshoot is ``force`` [m/s]."""
        return force / (self.latency * self.stiffness)


class Goal(NamedTuple):
    """What a client asks for."""

    opening: float       #: [m]
    speed: float         #: of the opening, until the first touch [m/s]
    force: float         #: limit of the stronger pad [N]
    until_touched: bool  #: the client gave no force: it stops when both pads are touched
    speed_is_fixed: bool = False  #: the gripper takes none

    def slow_speed(self, limits: TouchLimits) -> float:
        """Return the speed from the first touch on [m/s]."""
        return self.speed if self.speed_is_fixed else min(limits.slow_speed, self.speed)


def make_goal(opening: float, speed: float, force: float, limits: TouchLimits, *,
              speed_is_fixed: bool = False) -> Goal:
    """Return the goal to close to ``opening`` [m]; ``speed`` [m/s] and ``force`` [N] 0: not given.

    ``speed_is_fixed``: the gripper takes none, and closes at ``limits.fast_speed``. Raises RefusedGoalError for numbers
    out of range, and for a speed whose overshoot exceeds the force.

    >>> make_goal(0.0, 0.0, 0.6, TouchLimits(latency=0.06, stiffness=1000.0)).speed
    0.01
    """
    check_number('opening', opening, -BEYOND, HIGHEST_GAP, 'm')
    check_number('velocity', speed, 0.0, math.inf, 'm/s')
    check_number('effort', force, 0.0, limits.highest_force, 'N')
    limit = force or limits.touch_force
    chosen = limits.fast_speed if speed_is_fixed else min(limits.fast_speed, limits.fastest(limit))
    goal = Goal(opening, chosen if speed_is_fixed else speed or chosen, limit, not force, speed_is_fixed)
    if goal.speed > limits.fastest(limit):
        raise RefusedGoalError(
            'velocity', expected=f'at most {limits.fastest(goal.force):.3g} m/s for a force of {goal.force:g} N',
            got=f'{goal.speed:g} m/s: latency x speed x stiffness = {limits.overshoot(goal.speed):.3g} N',
            remedy='Close slower, or allow more force.')
    return goal


def check_number(name: str, value: float, low: float, high: float, unit: str) -> None:
    """Raise RefusedGoalError unless ``value`` is a number from ``low`` to ``high``."""
    if not low <= value <= high or math.isinf(value):
        raise RefusedGoalError(name, expected=f'{low:g} to {high:g} {unit}', got=f'{value:g} {unit}',
                               remedy='Correct the goal, or the parameters of the gripper node.')


class Closing:
    """One goal to close, from its start at ``now`` [s] and an ``opening`` [m], NaN: not known."""

    def __init__(self, goal: Goal, limits: TouchLimits, now: float, opening: float):
        self.goal, self._limits = goal, limits
        self._opening, self._looked = opening, now
        self._has_begun = False    # it was sent on its way
        self._was_held = False     # both pads were touched
        self._seen = now           # when all that it goes on by was last known
        self._waits = False        # at rest, until that is known again
        self._seen_touched = now   # when a contact was last seen
        self._one_sided: float | None = None  # travel since one pad alone is touched [m]
        self._slow_speed = goal.slow_speed(limits)
        self._pace = self._slow_speed if self._is_narrow() else goal.speed  # while it is seen [m/s]
        self._deadline = self._deadline_at(now)

    @property
    def speed(self) -> float:
        """Speed at which it goes on [m/s]; 0: it stops and waits."""
        return 0.0 if self._waits else self._pace

    def look(self, now: float, touch: Touch, opening: float, *, is_still: bool = True) -> Outcome | None:
        """Return why to end, by what is known at ``now`` [s]; None: go on at ``speed``.

        ``is_still``: a gripper that was to stop has done so. A late or incomplete frame ends no goal: it waits at rest.
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
        if stop is None and self._pace > self._slow_speed and (touch.is_touched or self._is_narrow()):
            self._pace = self._slow_speed
            self._deadline = self._deadline_at(now)
        return stop

    def _why_blind(self, now: float, touch: Touch) -> Outcome | None:
        if not touch.is_current(now, self._limits.max_age):
            return Outcome.NOT_SEEN
        is_enough = touch.contact is GraspContact.TWO_SIDED and self.goal.until_touched
        return None if touch.has_force or is_enough else Outcome.FORCE_NOT_KNOWN

    def _is_pressed(self, touch: Touch) -> bool:
        most = self.goal.force + self._limits.overshoot(self.goal.speed)
        return touch.has_force and touch.most(self._limits.edge_share) > most

    def _why_stop(self, now: float, touch: Touch) -> Outcome | None:
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

    def _follow(self, now: float, touch: Touch, travel: float) -> None:
        self._was_held |= touch.contact is GraspContact.TWO_SIDED
        if touch.is_touched:
            self._seen_touched = now
        if touch.contact is GraspContact.ONE_SIDED:
            self._one_sided = 0.0 if self._one_sided is None else self._one_sided + travel
        elif touch.contact is GraspContact.TWO_SIDED:
            self._one_sided = None

    def _travel(self, now: float, opening: float) -> float:
        """Return how far it has closed since it was looked at [m]: as commanded, where the opening is not known."""
        is_known = math.isfinite(opening) and math.isfinite(self._opening)
        travel = self._opening - opening if is_known else self.speed * (now - self._looked)
        self._opening, self._looked = opening, now
        return travel

    def _is_narrow(self) -> bool:
        return self._limits.slow_from > 0 and not self._opening > self._limits.slow_from  # nor one that is not known

    def _deadline_at(self, now: float) -> float:
        opening = self._opening if math.isfinite(self._opening) else self._limits.widest
        return deadline(now, opening - self.goal.opening, self._pace)


class Widening:
    """One goal to open to ``goal`` [m], whatever the pads see, from its start at ``now`` [s] and an ``opening``.

    ``opening`` [m]; NaN: not known.
    """

    def __init__(self, goal: float, limits: TouchLimits, now: float, opening: float):
        self._limits = limits
        self._force = math.nan  # of the stronger pad at its first current reading [N]
        self._deadline = deadline(now, goal - (opening if math.isfinite(opening) else 0.0), self.speed)

    @property
    def speed(self) -> float:
        """Speed at which it opens [m/s]."""
        return self._limits.fast_speed

    def look(self, now: float, touch: Touch, opening: float, *, is_still: bool = True) -> Outcome | None:
        """Return why to end, by what is known at ``now`` [s]; None: go on. The parameters are those of a `Closing`."""
        if touch.is_current(now, self._limits.max_age):
            self._force = touch.strongest if math.isnan(self._force) else self._force
            if touch.strongest > self._force + self._limits.touch_force:
                return Outcome.NOT_OPENING
        return Outcome.TOO_SLOW if now > self._deadline else None


class Rest:
    """Measures whether an opening has not changed for REST_TIME, from ``now`` [s] on."""

    def __init__(self, now: float):
        self._since, self._opening = now, math.nan

    def look(self, now: float, opening: float) -> bool:
        """Return True if it rests. ``opening`` [m]; NaN: not known, and counts as no change."""
        if math.isfinite(opening) and not abs(opening - self._opening) <= REST_CHANGE:
            self._since, self._opening = now, opening
        return now - self._since >= REST_TIME


class Clearing:
    """Waits, before a goal closes after a command in doubt, until the gripper has answered and is at rest.

    ``timeout`` [s]: for the answers to the cancels. A gripper that refuses a cancel and never ends the command is at
    rest only where its opening is measured.
    """

    def __init__(self, now: float, timeout: float):
        self._limit = now + timeout
        self._rest: Rest | None = None  # None: no answer yet
        self.is_over = False

    def look(self, now: float, opening: float, *, is_answered: bool, is_ended: bool) -> Outcome | None:
        """Return why the goal cannot close; None: go on. ``opening`` [m]; NaN: not known.

        ``is_answered``: the gripper has answered each cancel; ``is_ended``: by confirming it.
        """
        if self._rest is None and is_answered:
            self._rest = Rest(now)
        if self._rest is None:
            return Outcome.GRIPPER_SILENT if now > self._limit else None
        is_at_rest = self._rest.look(now, opening)
        self.is_over = is_at_rest and is_answered and (is_ended or math.isfinite(opening))
        return Outcome.NOT_STOPPED if not self.is_over and now > self._limit + REST_LIMIT else None


def deadline(now: float, travel: float, speed: float) -> float:
    """Return when a gripper that sets out ``now`` [s] for ``travel`` [m] at ``speed`` [m/s] is too slow."""
    return now + START_TIME + SLOWNESS * max(travel, 0.0) / speed
