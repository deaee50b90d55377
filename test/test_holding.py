"""Holding an object with a constant force.

The tests simulate a piece of creeping rubber between two pads, sensor noise, and a gripper that moves in steps.
"""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from tactile_node.grasp.tracker import GraspContact
from tactile_node.gripper.rules.closing import NO_TOUCH, ForceReading, Outcome, TouchReading, make_goal
from tactile_node.gripper.rules.holding import BLIND_TIME, SLIDE_PAUSE, SWAY_TIME, Holding
from tactile_node.gripper.rules.touch_settings import TouchSettings

FORCE = 5.0          # N
PERIOD = 0.02        # s
LOOK = 0.005         # s

# The sum of these two delays [s] is less than the latency.
SEEN_AFTER = 0.02
OBEYS_AFTER = 0.015
LIMITS = TouchSettings()


class Spring:
    """A held object that acts as a spring of ``stiffness`` [N/m].

    The gripper moves in whole steps of ``step`` [m]. The sensor noise is at most ``noise`` [N]. ``give(now)`` returns
    the decrease in the object's thickness [m].
    """

    def __init__(self, stiffness=1000.0, step=LIMITS.gripper_step, noise=0.0, give=lambda now: 0.0, seed=0):
        self.stiffness, self.step, self.noise, self.give = stiffness, step, noise, give
        self._random = np.random.default_rng(seed)
        self.place = self.first = 0.04
        self.width = self.first + FORCE / stiffness
        self.change = lambda touch, now: touch
        self.forces, self.corrections, self.speed, self.now = [], [], 0.0, 0.0

    @property
    def opening(self):
        return self.first + round((self.place - self.first) / self.step) * self.step

    def force(self):
        return max(0.0, self.stiffness * (self.width - self.give(self.now) - self.opening))

    def touch(self):
        errors = self._random.uniform(-1, 1, 2) * self.noise
        pads = tuple(ForceReading(max(0.0, self.force() + each)) for each in errors)
        contact = GraspContact.TWO_SIDED if self.force() > 0.05 else GraspContact.NO_CONTACT
        return self.change(TouchReading(self.now, True, contact, pads, force_sd=self.noise / 4), self.now)

    def hold(self, seconds, holding, knows_opening=True):
        """Run the control for ``seconds`` and return its outcome.

        The simulation delays commands and frames. The simulated gripper reports itself at rest as soon as it has
        stopped.
        """
        end, commands, frames, outcome = self.now + seconds, [], [(self.now, self.touch())], None
        while self.now < end and outcome is None:
            if self.now - frames[-1][0] > PERIOD - 1e-9:
                frames.append((self.now, self.touch()))
            seen = [touch for at, touch in frames[-3:] if at <= self.now - SEEN_AFTER + 1e-9] or [frames[0][1]]
            was = holding.speed
            outcome = holding.look(self.now, seen[-1], self.opening if knows_opening else math.nan,
                                   is_still=self.speed == 0.0 and not commands)
            if holding.speed != was:
                commands.append((self.now + OBEYS_AFTER, holding.speed, holding.target))
                if holding.speed:
                    self.corrections.append('eases' if holding.eases else 'closes')
            while commands and commands[0][0] <= self.now:
                _, self.speed, self.goal = commands.pop(0)
            if self.speed:
                travel = self.speed * LOOK
                self.place += max(-travel, min(travel, self.goal - self.place))
                if self.place == self.goal:
                    self.speed = 0.0
            self.forces.append(self.force())
            self.now += LOOK
        return outcome


def holding(limits=LIMITS, opening=0.04, force=FORCE, **hold):
    limits = replace(limits, **hold)
    return Holding(make_goal(0.0, 0.0, force, limits), limits, 0.0, opening)


def test_a_constant_force_causes_no_movement():
    spring = Spring(noise=0.1)
    assert spring.hold(20.0, holding()) is None and not spring.corrections and spring.place == spring.first


@pytest.mark.parametrize(('stiffness', 'creep'), [(1000.0, 0.002), (300.0, 0.004)])
def test_rubber_that_creeps_is_followed_within_the_deadband(stiffness, creep):
    """The rubber creeps by ``creep`` [m], fast at first and slower later.

    Without corrections, the force would fall by 2 N in the first case and by 1.2 N in the second.
    """
    spring = Spring(stiffness, noise=0.05, give=lambda now: creep * (1 - math.exp(-now / 5)))
    control = holding()
    assert spring.hold(20.0, control) is None
    assert control.deadband == pytest.approx(1000 * 1e-4 + 0.06 * 0.005 * 1000 + 2 * 0.05)
    assert FORCE - control.deadband - 0.2 < min(spring.forces) and max(spring.forces) < FORCE + control.deadband
    assert set(spring.corrections) == {'closes'}


def test_a_growing_object_is_released_by_no_more_than_it_was_pressed():
    """The object shrinks by 1 mm, returns to its original size, and then grows by 3 mm."""
    spring = Spring(give=lambda now: 0.001 if now < 10 else 0.001 - 0.0005 * (now - 10))
    control = holding()
    spring.hold(9.0, control)
    closed = spring.first - spring.opening
    assert spring.corrections == ['closes'] and closed > 0.0005
    assert spring.hold(10.0, control) is None
    assert spring.corrections.count('closes') == 1
    assert spring.opening == pytest.approx(spring.first, abs=LIMITS.gripper_step)
    # The gripper opens no wider than at its first stop, because it may carry a heavy object.
    assert spring.forces[-1] > FORCE + 2


def test_the_gripper_opens_further_above_the_highest_force():
    limits = TouchSettings(highest_force=6.0)
    spring = Spring(give=lambda now: -0.0005 * now)
    control = holding(limits)
    spring.hold(10.0, control)
    assert spring.corrections and set(spring.corrections) == {'eases'} and spring.opening > spring.first + 0.003
    assert max(spring.forces) < 6.0 + control.deadband


def test_the_hold_never_opens_the_gripper_without_a_measured_opening():
    spring = Spring(give=lambda now: -0.0005 * now)
    spring.hold(10.0, holding(TouchSettings(highest_force=6.0)), knows_opening=False)
    assert not spring.corrections
    assert Spring(give=lambda now: 0.001).hold(5.0, holding(opening=math.nan), knows_opening=False) is None


@pytest.mark.parametrize('stiffness', [1000.0, 300.0])
@pytest.mark.parametrize('step', [1e-5, 1e-3])
@pytest.mark.parametrize('noise', [0.0, 0.4])
@pytest.mark.parametrize('offset', [-3.0, 3.0])
def test_no_correction_causes_another(stiffness, step, noise, offset):
    """All corrections must have the same sign, whatever the size of a gripper step.

    ``offset`` [N] is the error of the force that the control must correct.

    At the stiffness that the limits assume, one correction must be enough. One gripper step changes the force by up to
    1 N, which is larger than any other effect in this test.
    """
    # With this low limit, the control may also reduce the force.
    limits = TouchSettings(highest_force=5.0, gripper_step=step, hold_travel=0.05)
    spring = Spring(stiffness, step, noise, give=lambda now: -offset / stiffness)
    control = Holding(make_goal(0.0, 0.0, FORCE, limits), limits, 0.0, spring.first)
    assert spring.hold(20.0, control) is None
    counts = Counter(spring.corrections)
    assert len(counts) <= 1
    if stiffness == limits.stiffness:
        assert counts.total() == 1
    assert abs(spring.forces[-1] - FORCE) <= control.deadband + noise


def test_a_step_larger_than_declared_uses_up_the_travel():
    spring = Spring(step=2e-3, give=lambda now: 0.0012)
    control = holding(TouchSettings(highest_force=5.0), hold_travel=0.02)
    assert spring.hold(60.0, control) is Outcome.HOLD_ENDED
    assert len(spring.corrections) > 2


# For this touch, the control should close the gripper.
SEEN = TouchReading(0.0, True, GraspContact.TWO_SIDED, (ForceReading(2.0), ForceReading(2.0)))


def look(control, now, touch, opening=0.04):
    return control.look(now, touch, opening, is_still=True)


@pytest.mark.parametrize(('fault', 'end'), [
    ({'fresh': False}, Outcome.NOT_SEEN), ({'contact': GraspContact.UNSEEN}, Outcome.NOT_SEEN),
    ({'acquired': 0.5}, Outcome.NOT_SEEN), ({'acquired': -math.inf}, Outcome.NOT_SEEN),
    (NO_TOUCH._asdict(), Outcome.NOT_SEEN),
    ({'pads': (ForceReading(2.0, is_hidden=True), ForceReading(2.0))}, Outcome.FORCE_NOT_KNOWN),
    ({'pads': (ForceReading(), ForceReading(2.0))}, Outcome.FORCE_NOT_KNOWN)], ids=str)
@pytest.mark.parametrize('is_under_way', [False, True])
def test_the_gripper_rests_on_untrusted_readings_and_the_hold_ends_after_a_time(fault, end, is_under_way):
    control = holding()
    if is_under_way:
        assert look(control, 0.98, SEEN._replace(acquired=0.98)) is None and control.speed > 0
    began = 0.98 if is_under_way else 0.0
    for now in np.arange(1.0, began + BLIND_TIME, 0.01):
        assert look(control, now, SEEN._replace(**{'acquired': now, **fault})) is None and control.speed == 0.0
    now = began + BLIND_TIME + 0.02
    assert look(control, now, SEEN._replace(**{'acquired': now, **fault})) is end and control.speed == 0.0


def test_a_frame_that_is_not_seen_begins_no_correction_and_may_end_one():
    control = holding()
    unseen = SEEN._replace(acquired=0.62, contact=GraspContact.UNSEEN, pads=(ForceReading(), ForceReading(2.0)))
    enough = SEEN._replace(acquired=0.6, pads=(ForceReading(5.0), ForceReading(5.0)))
    look(control, 0.62, unseen.after(enough._replace(pads=(ForceReading(2.0), ForceReading(5.0)))))
    assert control.speed == 0.0
    look(control, 0.64, SEEN._replace(acquired=0.64))
    assert control.speed > 0
    pressed = unseen._replace(pads=(ForceReading(), ForceReading(5.0)))
    look(control, 0.66, pressed.after(SEEN._replace(acquired=0.64)))
    assert control.speed == 0.0


def test_the_same_touch_when_it_is_trusted_is_followed():
    control = holding()
    assert look(control, 0.5, SEEN._replace(acquired=0.5)) is None and (control.speed, control.target) == (
        LIMITS.slow_speed, 0.0)


@pytest.mark.parametrize(('pads', 'speed'), [
    ((ForceReading(4.0, is_bound=True), ForceReading(2.0)), 0.0),  # A lower bound of 4 N allows a force of up to 8 N.
    # Lower bounds of 1.5 N allow a force of at most 3 N.
    ((ForceReading(1.5, is_bound=True), ForceReading(1.5)), LIMITS.slow_speed),
    ((ForceReading(4.9), ForceReading(1.0)), 0.0),  # The stronger pad sets the limit.
    ((ForceReading(9.0), ForceReading(4.9)), 0.0)])  # A load pushes the object against one pad.
def test_the_gripper_closes_by_the_highest_possible_and_opens_by_the_lowest_force(pads, speed):
    control = holding(opening=0.05)
    look(control, 0.5, SEEN._replace(acquired=0.5, pads=pads))
    assert control.speed == speed


def test_a_gripper_that_moves_still_is_waited_for_and_what_was_seen_before_it_stopped_is_not_judged():
    control = holding()
    control.look(0.5, SEEN._replace(acquired=0.5), 0.04, is_still=False)
    assert control.speed == 0.0
    # A frame acquired so soon after the stop that it lies within the latency must not be used.
    look(control, 0.55, SEEN._replace(acquired=0.55))
    assert control.speed == 0.0
    look(control, 0.57, SEEN._replace(acquired=0.57))
    assert control.speed > 0


@pytest.mark.parametrize(('contact', 'pads', 'end'), [
    (GraspContact.NO_CONTACT, (ForceReading(0.0), ForceReading(0.0)), Outcome.LOST),
    (GraspContact.ONE_SIDED, (ForceReading(2.0), ForceReading(0.0)), Outcome.ONE_SIDED)])
def test_an_object_that_only_one_pad_holds_is_not_followed_and_ends_the_hold(contact, pads, end):
    control = holding()
    look(control, 0.5, SEEN._replace(acquired=0.5))
    assert control.speed > 0
    gone = SEEN._replace(contact=contact, pads=pads)
    # The missing contact may be a bounce.
    assert look(control, 0.55, gone._replace(acquired=0.55)) is None and control.speed == 0.0
    assert look(control, 0.61, gone._replace(acquired=0.61)) is end


def test_the_travel_ends_the_hold_even_if_the_opening_does_not_change():
    """A gripper may press without moving, or relax each time it is stopped.

    Without a limit on its travel, this gripper would press for ever.
    """
    spring = Spring(give=lambda now: 0.0002 * now)
    assert spring.hold(60.0, holding()) is Outcome.HOLD_ENDED
    assert spring.first - spring.opening == pytest.approx(0.005, abs=1e-3)
    control, now = holding(), 0.1
    while look(control, now, SEEN._replace(acquired=now)) is None and now < 10:
        now += 0.01
    assert now == pytest.approx(0.1 + 0.005 / LIMITS.slow_speed, abs=0.02) and control.speed == 0.0
    fast = holding()
    look(fast, 0.1, SEEN._replace(acquired=0.1))
    # The gripper moved faster than its commanded speed.
    assert look(fast, 0.12, SEEN._replace(acquired=0.12), 0.034) is Outcome.HOLD_ENDED


def test_the_force_rises_in_steps_during_a_slide_up_to_the_highest_force():
    limits = TouchSettings(highest_force=6.5)
    spring, steps = Spring(), []

    def sliding(touch, now):
        steps.extend([(now, round(control.force, 6))] if not steps or round(control.force, 6) != steps[-1][1] else [])
        return touch._replace(slides=(math.nan, 1.0))
    control = holding(limits, slide_force_step=0.3)
    spring.change = sliding
    assert spring.hold(10.0, control) is None
    assert [force for _, force in steps] == pytest.approx([5.0, 5.3, 5.6, 5.9, 6.2, 6.5])
    pauses = np.diff([at for at, _ in steps])
    assert pauses[0] >= SWAY_TIME and min(pauses[1:]) >= SLIDE_PAUSE - 0.1
    assert spring.forces[-1] == pytest.approx(6.5, abs=control.deadband)
    assert len(spring.corrections) >= 4  # Each step is corrected, although it is smaller than the deadband.


def test_without_the_parameter_sliding_changes_nothing():
    spring = Spring()
    spring.change = lambda touch, now: touch._replace(slides=(math.nan, 1.0))
    control = holding()
    assert spring.hold(5.0, control) is None and control.force == FORCE and not spring.corrections


@pytest.mark.parametrize(('frequency', 'is_answered'), [(6.0, False), (2.0, False), (0.5, True)])
def test_the_force_does_not_react_to_an_object_that_sways_on_a_shaken_hand(frequency, is_answered):
    """The object moves back and forth along both pads. Only a movement in one direction for 1 s counts as a slide."""
    def swaying(touch, now):
        turn = math.pi * (math.sin(2 * math.pi * frequency * now) < 0)
        return touch._replace(slides=(math.pi / 2 - turn, turn - math.pi / 2))
    assert (answered_to(swaying) > FORCE) == is_answered


def answered_to(change):
    """Return the holding force after 3 s of touches whose slides are set by ``change``."""
    spring, control = Spring(), holding(slide_force_step=0.3)
    spring.change = change
    assert spring.hold(3.0, control) is None
    return control.force


@pytest.mark.parametrize('ways', [
    [(1.0, 1.1, (1.0, math.nan)), (1.1, 1.5, (1.0 - math.pi, math.nan))],  # The object moves back and forth once.
    [(1.0, 1.4, (1.0, math.nan)), (1.4, 1.8, (math.nan, math.nan)), (1.8, 2.2, (1.0, math.nan))]], ids=['sway', 'two'])
def test_a_short_slide_is_not_answered_though_its_report_outlasts_it(ways):
    assert answered_to(lambda touch, now: next(
        (touch._replace(slides=slides) for begin, end, slides in ways if begin <= now < end), touch)) == FORCE


def test_a_slide_that_one_pad_shows_after_the_other_goes_on():
    pads = [(1.0, math.nan), (1.0, -1.0), (math.nan, -1.0)]
    assert answered_to(lambda touch, now: touch._replace(
        slides=pads[min(2, int((now - 1.0) / 0.3))] if 1.0 <= now < 1.9 else (math.nan, math.nan))) > FORCE


def test_unseen_time_does_not_count_as_a_slide():
    def blind_in_between(touch, now):
        slides = (1.0, math.nan) if 1.0 <= now < 1.05 or 1.55 <= now < 1.6 else (math.nan, math.nan)
        return touch._replace(slides=slides, fresh=not 1.05 <= now < 1.55)
    assert answered_to(blind_in_between) == FORCE


def test_a_suspended_hold_corrects_nothing_and_answers_no_slide():
    """While something may touch the object, a correction would look like a touch."""
    spring, control = Spring(give=lambda now: 0.0015 * (now > 1)), holding(slide_force_step=0.3)
    spring.change = lambda touch, now: touch._replace(slides=(math.nan, 1.0))
    control.is_suspended = True
    assert spring.hold(4.0, control) is None
    assert not spring.corrections and control.force == FORCE and spring.forces[-1] == pytest.approx(3.5)
    control.is_suspended = False
    assert spring.hold(0.3, control) is None and control.force == FORCE  # the slide counts from now on
    assert spring.hold(3.0, control) is None and control.force > FORCE
    assert 'closes' in spring.corrections


def test_a_suspended_hold_still_ends_with_a_lost_object():
    spring, control = Spring(give=lambda now: 0.02 * (now > 1)), holding()
    control.is_suspended = True
    assert spring.hold(4.0, control) is Outcome.LOST
