"""Holding with a force what was closed on: when to press harder, when to ease off, and when to end.

Pure: time is what it is given. Rules of trust as in closing.py: by what may be most it closes, by what is at least it
opens, and without a force that is known it rests.

A correction begins where both pads read more than a deadband D beside the force, and ends at the force. It goes beyond
by what the gripper moves until it stops, and by a step of it: at most stiffness x (latency x speed + gripper_step). Of
two readings each is wrong by n at most. With D = that + 2 n, what is read afterwards is at most D beyond the force, so
no correction causes the opposite one. To press again takes a reading D below the force.
"""

import math
from dataclasses import dataclass

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.closing import LOST_AFTER, Goal, Outcome, Touch, TouchLimits
from tactile_node.grasp.tracker import GraspContact

NOISE_CERTAINTY = 4.0  #: standard deviations that a reading is wrong by at most
BLIND_TIME = 1.0       #: s without a force that is known, after which it ends
SLIDE_PAUSE = 1.0      #: s between two answers to sliding
#: s for which a slide one way is reported before the answer: 0.2 s of it, and 0.3 s by which a report outlasts it
#: (pose/track.py). On a shaken hand the object sways in the soft skin, and comes back
SWAY_TIME = 0.5


@dataclass(frozen=True)
class HoldLimits:
    """Limits of holding. Raises ConfigurationError for those out of range."""

    gripper_step: float = 1e-4     #: smallest change of its opening that the gripper makes [m]
    hold_travel: float = 0.005     #: of all corrections together, at most [m]
    slide_force_step: float = 0.0  #: by which the force rises where the object slides [N]; 0: it does not

    def __post_init__(self) -> None:
        if not (0 < self.gripper_step < math.inf and 0 < self.hold_travel < math.inf
                and 0 <= self.slide_force_step < math.inf):
            raise ConfigurationError('limits of holding', expected='gripper_step and hold_travel above 0, '
                                     'slide_force_step not below', got=str(self),
                                     remedy='Correct the parameters of the gripper node.')


class Holding:
    """The hold after ``goal``, whose force it keeps, from ``now`` [s] and an ``opening`` [m] on, NaN: not known."""

    def __init__(self, goal: Goal, limits: TouchLimits, hold: HoldLimits, now: float, opening: float):
        self._goal, self._limits, self._hold, self._first = goal, limits, hold, opening
        self.force = goal.force     #: that it keeps [N]
        self.target = opening       #: to which it goes [m]
        self.speed = 0.0            #: at which it goes there [m/s]; 0: it rests
        self.eases = False          #: what it does, or did last, is to open
        self._slow = goal.slow_speed(limits)
        self._rested = self._known = self._held = now
        self._begun, self._begun_opening = now, opening  # the correction
        self._noise, self._used = 0.0, 0.0    # [N]; travel of the corrections before [m]
        self._answered = -math.inf            # to sliding
        self._slides, self._slid_since = (math.nan, math.nan), now  # directions at first

    @property
    def deadband(self) -> float:
        """How far beside the force a correction begins [N]."""
        step = self._limits.stiffness * self._hold.gripper_step
        return step + self._limits.overshoot(self._slow) + 2 * self._noise

    def look(self, now: float, touch: Touch, opening: float, *, is_still: bool) -> Outcome | None:
        """Return why it has ended, by what is known at ``now`` [s]; None: go on to ``target`` at ``speed``.

        ``is_still``: the gripper has confirmed that it rests.
        """
        is_seen = touch.is_current(now, self._limits.max_age)
        if is_seen:
            self._follow(now, touch)
        else:
            self._slides = math.nan, math.nan  # whether it went on is not known
        is_trusted = is_seen and touch.has_force and touch.contact is GraspContact.TWO_SIDED
        end = self._why_end(now, touch, opening, is_seen)
        if end is not None or not is_trusted or (self.speed and self._is_corrected(touch, is_still)):
            self._rest(now, opening)
        elif not self.speed and not is_still:
            self._rested = now
        elif not self.speed and touch.is_whole and touch.acquired >= self._rested + self._limits.latency:
            self._correct(now, touch, opening)
        return end

    def _follow(self, now: float, touch: Touch) -> None:
        if touch.has_force:
            self._known = now
        if touch.contact is GraspContact.TWO_SIDED:
            self._held = now
        if math.isfinite(touch.force_sd):
            self._noise = NOISE_CERTAINTY * touch.force_sd
        self._follow_slide(now, touch)

    def _follow_slide(self, now: float, touch: Touch) -> None:
        """Note since when it slides one way: since now where it does not, or goes another way on both pads."""
        if any(math.cos(first - last) > 0 for first, last in zip(self._slides, touch.slides)):
            left, right = (last if math.isnan(first) else first for first, last in zip(self._slides, touch.slides))
            self._slides = left, right
        else:
            self._slides, self._slid_since = touch.slides, now

    def _why_end(self, now: float, touch: Touch, opening: float, is_seen: bool) -> Outcome | None:
        if now - self._known > BLIND_TIME:
            return Outcome.FORCE_NOT_KNOWN if is_seen else Outcome.NOT_SEEN
        if is_seen and now - self._held > LOST_AFTER:
            return Outcome.ONE_SIDED if touch.is_touched else Outcome.LOST
        return Outcome.HOLD_ENDED if self._used + self._travelled(now, opening) >= self._hold.hold_travel else None

    def _travelled(self, now: float, opening: float) -> float:
        """Return the travel of the correction under way [m]: as commanded, or as measured where that is more.

        A gripper that presses without moving, or goes back whenever it is stopped, comes to an end, too.
        """
        return max(self.speed * (now - self._begun), abs(self._begun_opening - opening)) if self.speed else 0.0

    def _is_corrected(self, touch: Touch, is_still: bool) -> bool:
        if self.eases:
            return is_still or touch.weakest <= self.force
        return touch.most(self._limits.edge_share) >= self.force

    def _rest(self, now: float, opening: float) -> None:
        self._used += self._travelled(now, opening)
        self.speed, self._rested = 0.0, now

    def _correct(self, now: float, touch: Touch, opening: float) -> None:
        """Begin a correction where one is needed."""
        is_answer = self._answers(now)
        lack = self.force - touch.most(self._limits.edge_share)
        excess = touch.weakest - self.force
        self._begun, self._begun_opening = now, opening
        if lack > (0.0 if is_answer else self.deadband):
            self.target, self.speed, self.eases = self._goal.opening, self._slow, False
        elif excess > self.deadband and math.isfinite(opening):
            target = opening + excess / self._limits.stiffness
            if touch.strongest <= self._limits.highest_force:
                target = min(self._first, target)  # in this order: NaN where the former is not known
            if target >= opening + self._hold.gripper_step:
                self.target, self.speed, self.eases = target, self._slow, True

    def _answers(self, now: float) -> bool:
        """Raise the force where the object has slid one way for long enough; return whether it did."""
        raised = min(self.force + self._hold.slide_force_step, self._limits.highest_force)
        if now - self._slid_since < SWAY_TIME or raised <= self.force or now - self._answered < SLIDE_PAUSE:
            return False
        self.force, self._answered = raised, now
        return True
