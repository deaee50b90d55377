"""Hold an object with a force after closing, and decide when to press harder, to ease off and to end the hold.

The callers of this module pass the current time, because the module reads no clock. The module trusts readings by the
same rules as closing.py. The decision to press harder uses the highest force that the readings allow, and the decision
to ease off uses the lowest force. The gripper rests while the force is unknown.

A correction begins if the readings of both pads differ from the target force by more than a deadband D. The correction
ends at the target force. The overshoot of a correction has two causes: the travel until the gripper stops, and one step
of the gripper. The overshoot is at most stiffness x (latency x speed + gripper_step). Let n be the largest error of a
reading, so that two readings together are wrong by at most 2 n. With D = overshoot + 2 n, the next reading is at most D
beyond the target force. No correction therefore causes the opposite correction. The gripper presses again only if a
reading is D below the target force.
"""

import math

from tactile_node.grasp.tracker import GraspContact
from tactile_node.gripper.rules.closing import LOST_AFTER, Goal, Outcome, TouchReading
from tactile_node.gripper.rules.touch_settings import TouchSettings

NOISE_CERTAINTY = 4.0  #: Largest error of a reading [standard deviations].
BLIND_TIME = 1.0       #: Time without a known force after which the hold ends [s].
SLIDE_PAUSE = 1.0      #: Shortest time between two reactions to sliding [s].

#: Time for which a slide in one direction must be reported before the hold reacts [s]. This time allows for 0.2 s of
#: sliding, and for the 0.3 s by which a report outlasts the slide (pose/track.py). A shorter slide may be sway: on a
#: shaken hand, the object sways in the soft skin and returns.
SWAY_TIME = 0.5


class Holding:
    """Holds an object after a goal, with the force of that goal. The parameters are those of `Closing`."""

    def __init__(self, goal: Goal, limits: TouchSettings, now: float, opening: float):
        self._goal, self._limits, self._first = goal, limits, opening
        self.force = goal.force  #: force to keep [N]
        self.target = opening    #: opening to which the gripper moves [m]
        self.speed = 0.0         #: speed of the movement to ``target`` [m/s]; 0 while the gripper rests
        self.eases = False       #: True if the current or latest correction opens the gripper
        #: True if no correction may begin, because it would look like a touch of the object (put_down.py)
        self.is_suspended = False
        self._rested = self._known = self._held = now
        self._begun, self._begun_opening = now, opening  # start of the current correction
        self._noise = 0.0           # largest error of a reading [N]
        self._used = 0.0            # travel of all earlier corrections [m]
        self._answered = -math.inf  # time of the latest reaction to sliding
        self._slides = math.nan, math.nan  # directions at the beginning of the current slide
        self._slid_since = now      # beginning of the current slide

    @property
    def deadband(self) -> float:
        """Deviation from the target force at which a correction begins [N]."""
        step = self._limits.stiffness * self._limits.gripper_step
        return step + self._limits.overshoot(self._goal.slow_speed) + 2 * self._noise

    def look(self, now: float, touch: TouchReading, opening: float, *, is_still: bool) -> Outcome | None:
        """Return the outcome that ends the hold, or None to continue to ``target`` at ``speed``.

        The parameters are those of `Closing.look`.
        """
        is_seen = touch.is_current(now, self._limits.max_age)
        if is_seen:
            self._follow(now, touch)
        if self.is_suspended or not is_seen:
            self._slides = math.nan, math.nan  # a slide may have ended unseen, and a suspended hold answers to none
        is_trusted = is_seen and touch.has_force and touch.contact is GraspContact.TWO_SIDED
        end = self._why_end(now, touch, opening, is_seen)
        if end is not None or not is_trusted or (self.speed and self._is_corrected(touch, is_still)):
            self._rest(now, opening)
        elif not self.speed and not is_still:
            self._rested = now
        elif not self.speed and self._may_correct(touch):
            self._correct(now, touch, opening)
        return end

    def _may_correct(self, touch: TouchReading) -> bool:
        """Return True if the readings are newer than the effects of the latest movement."""
        is_settled = touch.acquired >= self._rested + self._limits.latency
        return is_settled and touch.is_whole and not self.is_suspended

    def _follow(self, now: float, touch: TouchReading) -> None:
        if touch.has_force:
            self._known = now
        if touch.contact is GraspContact.TWO_SIDED:
            self._held = now
        if math.isfinite(touch.force_sd):
            self._noise = NOISE_CERTAINTY * touch.force_sd
        self._follow_slide(now, touch)

    def _follow_slide(self, now: float, touch: TouchReading) -> None:
        """Store the time at which a slide in one direction began.

        The stored time is reset to ``now`` if the object does not slide, or if the direction has changed on both pads.
        """
        if any(math.cos(first - last) > 0 for first, last in zip(self._slides, touch.slides)):
            left, right = (last if math.isnan(first) else first for first, last in zip(self._slides, touch.slides))
            self._slides = left, right
        else:
            self._slides, self._slid_since = touch.slides, now

    def _why_end(self, now: float, touch: TouchReading, opening: float, is_seen: bool) -> Outcome | None:
        if now - self._known > BLIND_TIME:
            return Outcome.FORCE_NOT_KNOWN if is_seen else Outcome.NOT_SEEN
        if is_seen and now - self._held > LOST_AFTER:
            return Outcome.ONE_SIDED if touch.is_touched else Outcome.LOST
        return Outcome.HOLD_ENDED if self._used + self._travelled(now, opening) >= self._limits.hold_travel else None

    def _travelled(self, now: float, opening: float) -> float:
        """Return the commanded or measured travel of the current correction, whichever is larger [m].

        A hold therefore also ends if the gripper presses without moving, or if the gripper moves back whenever it is
        stopped.
        """
        return max(self.speed * (now - self._begun), abs(self._begun_opening - opening)) if self.speed else 0.0

    def _is_corrected(self, touch: TouchReading, is_still: bool) -> bool:
        if self.eases:
            return is_still or touch.weakest <= self.force
        return touch.most(self._limits.edge_share) >= self.force

    def _rest(self, now: float, opening: float) -> None:
        self._used += self._travelled(now, opening)
        self.speed, self._rested = 0.0, now

    def _correct(self, now: float, touch: TouchReading, opening: float) -> None:
        """Begin a correction if one is needed."""
        is_answer = self._answers(now)
        lack = self.force - touch.most(self._limits.edge_share)
        excess = touch.weakest - self.force
        self._begun, self._begun_opening = now, opening
        if lack > (0.0 if is_answer else self.deadband):
            self.target, self.speed, self.eases = self._goal.opening, self._goal.slow_speed, False
        elif excess > self.deadband and math.isfinite(opening):
            target = opening + excess / self._limits.stiffness
            if touch.strongest <= self._limits.highest_force:
                # NaN comes first, so that the result is NaN if the first opening is unknown
                target = min(self._first, target)
            if target >= opening + self._limits.gripper_step:
                self.target, self.speed, self.eases = target, self._goal.slow_speed, True

    def _answers(self, now: float) -> bool:
        """Raise the force if the object has slid in one direction for long enough, and return True if so."""
        raised = min(self.force + self._limits.slide_force_step, self._limits.highest_force)
        if now - self._slid_since < SWAY_TIME or raised <= self.force or now - self._answered < SLIDE_PAUSE:
            return False
        self.force, self._answered = raised, now
        return True
