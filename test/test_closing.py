"""Tests for a gripper that closes until it touches an object: its reasons to stop and the resulting force.

The pads press against simulated springs.
"""

import math

import pytest

from tactile_node.errors import ConfigurationError, RefusedGoalError
from tactile_node.grasp.tracker import GraspContact
from tactile_node.gripper.rules.closing import (
    BLIND_TIME,
    NO_TOUCH,
    REST_CHANGE,
    REST_LIMIT,
    REST_TIME,
    SLOWNESS,
    START_TIME,
    Clearing,
    Closing,
    ForceReading,
    Outcome,
    TouchReading,
    Widening,
    make_goal,
)
from tactile_node.gripper.rules.touch_settings import TouchSettings
from tactile_node.parameter import table

PERIOD = 0.02  # Time between two frames [s].
LATENCY = 0.04  # Delay until the control sees a frame [s].
THRESHOLD = 0.05  # Force above which a pad counts as touched [N].
EMPTY = ForceReading(0.0)
LIMITS = TouchSettings()


class World:
    """Two pads that close on an object of ``width`` [m], whose centre is ``off`` [m] away from the middle.

    ``stiffness`` [N/m] is the increase in the force on a touched pad per metre that the gripper closes.
    """

    def __init__(self, width=0.04, off=0.0, stiffness=1000.0, start=0.06, bends=None):
        self.width, self.off, self.stiffness, self.opening = width, off, stiffness, start
        self.bends = bends or (lambda pad, now: pad)
        self.seen = []  # Pairs of acquisition time and touch.
        self.strongest = 0.0

    def depth(self, side):
        """Return how far a pad is pressed into the object, which does not move."""
        return (self.width - self.opening) / 2 - side * self.off

    def touch(self, now):
        depths = [self.depth(1), self.depth(-1)]
        forces = [max(0.0, 2 * self.stiffness * each) for each in depths]
        self.strongest = max(self.strongest, *forces)
        pads = [self.bends(ForceReading(force), now) for force in forces]
        contact = GraspContact(GraspContact.NO_CONTACT + sum(force > THRESHOLD for force in forces))
        return TouchReading(now, True, contact, tuple(pads))

    def close(self, closing, limit=30.0, seen=None, step=0.001):
        """Close until the control stops, and return the outcome and the time."""
        now, outcome, frames = 0.0, None, []
        while outcome is None and now < limit:
            if round(now / PERIOD) * PERIOD == pytest.approx(now, abs=step / 2):
                frames.append((now, self.touch(now)))
            current = [touch for at, touch in frames if at <= now - LATENCY]
            touch = current[-1] if current else TouchReading(now, True, GraspContact.NO_CONTACT, (EMPTY, EMPTY))
            outcome = closing.look(now, seen(touch, now) if seen else touch, self.opening)
            self.opening -= closing.speed * step
            now += step
        return outcome, now


def closing(force=0.0, opening=0.0, speed=0.0, limits=LIMITS, start=0.06):
    return Closing(make_goal(opening, speed, force, limits), limits, 0.0, start)


def test_the_gripper_stops_without_a_force_limit_when_both_pads_are_touched():
    world = World()
    outcome, _ = world.close(closing())
    assert outcome is Outcome.TOUCHED and 0 < world.strongest < LIMITS.overshoot(LIMITS.fast_speed)


@pytest.mark.parametrize('force', [1.0, 5.0, 12.0])
def test_the_gripper_stops_once_the_stronger_pad_reads_the_force(force):
    world = World()
    outcome, _ = world.close(closing(force))
    assert outcome is Outcome.FORCE_REACHED
    assert force <= world.strongest <= force + THRESHOLD + LIMITS.overshoot(LIMITS.slow_speed)


def test_a_force_on_only_one_pad_is_not_a_firm_grasp():
    world = World(off=0.02, start=0.1)
    assert world.close(closing(1.0, start=0.1))[0] is Outcome.ONE_SIDED
    assert world.depth(1) < 0 and 1.0 < world.strongest < 1.4


@pytest.mark.parametrize('travel', [0.0, 0.003])
def test_the_gripper_continues_for_a_limited_travel_while_one_pad_is_touched(travel):
    limits = TouchSettings(one_sided_travel=travel)
    world = World(off=0.02, stiffness=10.0, start=0.1)
    outcome, _ = world.close(closing(5.0, limits=limits, start=0.1))
    assert outcome is Outcome.ONE_SIDED
    first_touch = 0.04 + 2 * 0.02 - THRESHOLD / 10  # At this opening, the force on one pad reaches the threshold.
    assert 0 <= first_touch - world.opening - travel < limits.fast_speed * (LATENCY + 2 * PERIOD)


@pytest.mark.parametrize(('fault', 'expected'), [
    (lambda touch, now: touch._replace(contact=GraspContact.UNSEEN), Outcome.NOT_SEEN),
    (lambda touch, now: touch._replace(contact=GraspContact.NOT_KNOWN), Outcome.NOT_SEEN),
    (lambda touch, now: touch._replace(fresh=False), Outcome.NOT_SEEN),
    (lambda touch, now: touch._replace(acquired=now - 0.2), Outcome.NOT_SEEN),
    (lambda touch, now: touch._replace(acquired=-math.inf), Outcome.NOT_SEEN),
    (lambda touch, now: NO_TOUCH, Outcome.NOT_SEEN)])
@pytest.mark.parametrize('at', [0.0, 0.5])
def test_the_gripper_closes_only_while_the_pads_are_seen_and_current(fault, expected, at):
    world = World()
    outcome, now = world.close(closing(), seen=lambda touch, now: fault(touch, now) if now >= at else touch)
    assert outcome is expected and now == pytest.approx(at + BLIND_TIME, abs=0.003)
    assert world.opening == pytest.approx(0.06 - at * LIMITS.fast_speed, abs=1e-4)


HIDDEN = (ForceReading(0.1, is_hidden=True), ForceReading(0.1, is_hidden=True))


@pytest.mark.parametrize(('fault', 'begin', 'end'), [
    (lambda touch: touch._replace(contact=GraspContact.UNSEEN), 0.0, 0.4),
    (lambda touch: touch._replace(contact=GraspContact.UNSEEN), 0.3, 0.7),
    (lambda touch: touch._replace(fresh=False), 1.2, 1.6),
    (lambda touch: touch._replace(pads=HIDDEN), 1.2, 1.6)])
def test_the_gripper_rests_while_a_pad_is_briefly_unseen(fault, begin, end):
    world, openings, control = World(), [], closing(2.0)

    def seen(touch, now):
        openings.extend([world.opening] * (begin <= now < end))
        return fault(touch) if begin <= now < end else touch
    outcome, _ = world.close(control, seen=seen)
    assert outcome is Outcome.FORCE_REACHED and 2.0 <= world.strongest <= 2.0 + LIMITS.overshoot(LIMITS.fast_speed)
    assert max(openings[1:]) - min(openings[1:]) < 1e-9
    assert openings[0] > world.opening


def test_closing_continues_only_after_a_stop_and_slowly_after_a_touch():
    seen = TouchReading(1.0, True, GraspContact.ONE_SIDED, (ForceReading(0.5), EMPTY))
    control = closing(3.0)
    assert control.look(1.0, seen, 0.04) is None
    assert control.look(1.2, seen._replace(acquired=1.2, fresh=False), 0.04) is None and control.speed == 0.0
    for is_still, speed in ((False, 0.0), (True, LIMITS.slow_speed)):
        assert control.look(1.3, seen._replace(acquired=1.3), 0.04, is_still=is_still) is None
        assert control.speed == speed


def test_time_in_which_the_gripper_has_yet_to_stop_is_not_blind_while_the_pads_are_seen():
    seen = TouchReading(0.0, True, GraspContact.NO_CONTACT, (EMPTY, EMPTY))
    control = closing(3.0)
    assert control.look(0.0, seen, 0.06) is None
    assert control.look(0.2, seen, 0.06) is None and control.speed == 0.0
    # A late frame has stopped the motion. New frames arrive before the gripper stands still.
    for now in (0.3, BLIND_TIME + 0.2):
        assert control.look(now, seen._replace(acquired=now), 0.06, is_still=False) is None
    assert control.look(BLIND_TIME + 0.4, seen._replace(acquired=BLIND_TIME + 0.2), 0.06, is_still=False) is None
    assert control.look(2 * BLIND_TIME + 0.3, seen, 0.06, is_still=False) is Outcome.NOT_SEEN


def test_a_gripper_that_hardly_moves_is_too_slow_even_if_pads_are_unseen_at_times():
    control, now, outcome, blind = closing(3.0), 0.0, None, 0.0
    while outcome is None and now < 60.0:
        is_seen = now % 1.0 < 0.7
        blind += 0.0 if is_seen else 0.01
        outcome = control.look(now, TouchReading(now, is_seen, GraspContact.NO_CONTACT, (EMPTY, EMPTY)), 0.0599)
        now += 0.01
    assert outcome is Outcome.TOO_SLOW
    assert now - blind == pytest.approx(START_TIME + SLOWNESS * 0.06 / LIMITS.fast_speed, abs=0.3)


def test_one_frame_that_is_not_seen_changes_nothing_but_what_the_other_pad_reads():
    seen = TouchReading(1.0, True, GraspContact.TWO_SIDED, (ForceReading(1.0), ForceReading(2.0)))
    unseen = TouchReading(1.02, True, GraspContact.UNSEEN, (ForceReading(), ForceReading(4.0)))
    # The merged touch keeps the stamp of the earlier frame.
    assert unseen.after(seen) == seen._replace(pads=(ForceReading(1.0), ForceReading(4.0)), is_whole=False)
    assert seen.after(unseen) == seen and unseen.after(NO_TOUCH).is_seen is False
    control = closing(3.0)
    assert control.look(1.0, seen, 0.04) is None
    assert control.look(1.02, unseen.after(seen), 0.04) is Outcome.FORCE_REACHED
    blind = seen._replace(acquired=1.3, fresh=False)
    # The last fresh frame is 0.3 s old, so the pads count as not seen.
    assert closing(3.0).look(1.3, blind.after(seen), 0.04) is Outcome.NOT_SEEN


@pytest.mark.parametrize('pad', [ForceReading(0.1, is_hidden=True), ForceReading(math.nan)], ids=['hidden', 'on/off'])
def test_an_indefinite_force_is_not_trusted(pad):
    world = World(bends=lambda real, now: pad if real.force > 0 else real)
    assert world.close(closing(5.0))[0] is Outcome.FORCE_NOT_KNOWN
    assert world.strongest < 2 * LIMITS.overshoot(LIMITS.fast_speed)


def test_the_limit_has_a_margin_for_a_contact_that_extends_beyond_the_pad():
    world = World(bends=lambda real, now: ForceReading(real.force * 0.6, is_bound=True))
    assert world.close(closing(5.0))[0] is Outcome.FORCE_REACHED
    assert world.strongest <= 5.0 + LIMITS.overshoot(LIMITS.slow_speed)


def test_the_weaker_pad_does_not_hold_the_limit_back():
    forces = iter([ForceReading(6.0), ForceReading(0.1)] * 1000)
    world = World(bends=lambda real, now: next(forces) if real.force > 0.05 else real)
    assert world.close(closing(5.0))[0] is Outcome.FORCE_REACHED and world.strongest < 2.0


def test_an_object_that_was_held_and_is_gone_is_lost():
    def lose(touch, now):
        return TouchReading(now, True, GraspContact.NO_CONTACT, (EMPTY, EMPTY)) if now > 1.3 else touch
    world = World(stiffness=100.0)
    outcome, now = world.close(closing(12.0), seen=lose)
    assert outcome is Outcome.LOST and 1.4 < now < 1.45


def test_the_gripper_slows_down_at_the_first_touch_or_below_an_opening():
    control = closing()
    empty = TouchReading(0.0, True, GraspContact.NO_CONTACT, (EMPTY, EMPTY))
    control.look(0.0, empty, 0.06)
    assert control.speed == LIMITS.fast_speed
    touched = empty._replace(acquired=0.02, contact=GraspContact.ONE_SIDED, pads=(ForceReading(0.1), EMPTY))
    control.look(0.02, touched, 0.05)
    assert control.speed == LIMITS.slow_speed
    control.look(0.04, empty._replace(acquired=0.04), 0.05)
    assert control.speed == LIMITS.slow_speed  # The gripper stays slow, because the touched object is near.
    narrow = closing(limits=TouchSettings(slow_from=0.055))
    narrow.look(0.0, empty, 0.0551)
    assert narrow.speed == LIMITS.fast_speed
    narrow.look(0.02, empty._replace(acquired=0.02), 0.0549)
    assert narrow.speed == LIMITS.slow_speed


@pytest.mark.parametrize(('asked', 'name'), [
    ((math.nan, 0, 0), 'opening'), ((math.inf, 0, 0), 'opening'), ((-0.01, 0, 0), 'opening'),
    ((0, math.nan, 0), 'velocity'), ((0, -0.01, 0), 'velocity'), ((0, math.inf, 0), 'velocity'),
    ((0, 0, math.nan), 'effort'), ((0, 0, -1), 'effort'), ((0, 0, math.inf), 'effort'), ((0, 0, 20.1), 'effort')])
def test_a_goal_of_impossible_numbers_is_refused(asked, name):
    with pytest.raises(RefusedGoalError, match=name):
        make_goal(*asked, LIMITS)


def test_a_speed_whose_overshoot_exceeds_the_force_is_refused_with_the_numbers():
    """At 0.05 m/s, the overshoot is 0.06 s x 0.05 m/s x 1000 N/m = 3 N."""
    with pytest.raises(RefusedGoalError, match=r'at most 0\.0333 m/s for a force of 2 N.*= 3 N'):
        make_goal(0.0, 0.05, 0.0, LIMITS)
    with pytest.raises(RefusedGoalError, match=r'at most 0\.01 m/s'):
        # A gripper with a fixed speed cannot close more slowly.
        make_goal(0.0, 0.0, 0.6, LIMITS, speed_is_fixed=True)
    # A goal without a speed gets a lower speed instead of being refused.
    assert make_goal(0.0, 0.0, 0.6, LIMITS).speed == pytest.approx(0.01)
    with pytest.raises(ConfigurationError, match='fast_speed'):
        TouchSettings(fast_speed=0.05)


@pytest.mark.parametrize('changed', [
    {'stop_by': 'luck'}, {'slow_speed': 0.03}, {'touch_force': 30.0}], ids=str)
def test_contradicting_settings_are_refused(changed):
    with pytest.raises(ConfigurationError):
        TouchSettings(**changed)


def test_each_number_has_a_range_that_the_parameters_enforce():
    """The rules divide by these numbers or wait for them, and none of them may be negative or infinite."""
    may_be_0 = {'slow_from', 'one_sided_travel', 'slide_force_step'}
    for name, default, properties in table(TouchSettings):
        if isinstance(default, float):
            assert properties.low <= default <= properties.high < math.inf
            assert properties.low == 0 if name in may_be_0 else properties.low > 0, name


@pytest.mark.parametrize('contact', [GraspContact.ONE_SIDED, GraspContact.TWO_SIDED])
@pytest.mark.parametrize(('force', 'speed', 'least'), [(2.0, 0.0, 3.2), (2.0, 0.005, 2.3), (0.0, 0.0, 3.2)])
def test_pads_that_read_more_than_the_goal_and_its_overshoot_are_already_pressed(contact, force, speed, least):
    """The overshoot is 0.06 s x 0.02 m/s x 1000 N/m = 1.2 N at 0.02 m/s, and 0.3 N at 0.005 m/s."""
    other = ForceReading(0.2) if contact is GraspContact.TWO_SIDED else EMPTY
    for read, is_pressed in ((least + 0.01, True), (least - 0.01, False)):
        seen = TouchReading(0.0, True, contact, (ForceReading(read), other))
        outcome = closing(force, speed=speed).look(0.0, seen, 0.04)
        assert (outcome is Outcome.ALREADY_PRESSED) == is_pressed and outcome is not None


def test_a_force_that_rises_on_the_way_is_not_one_that_was_there_before():
    control = closing(2.0)
    assert control.look(0.0, TouchReading(0.0, True, GraspContact.NO_CONTACT, (EMPTY, EMPTY)), 0.05) is None
    pressed = TouchReading(0.02, True, GraspContact.TWO_SIDED, (ForceReading(9.0), ForceReading(9.0)))
    assert control.look(0.02, pressed, 0.04) is Outcome.FORCE_REACHED


def clear(opening, is_answered, timeout=0.5, is_ended=True):
    """Wait until the gripper has answered and is at rest, and return the outcome and the time [s].

    ``opening(now)`` is the opening [m], and ``is_answered(now)`` is True once the gripper has answered.
    """
    control, now, end = Clearing(0.0, timeout), 0.0, None
    while end is None and not control.is_over:
        now += 0.01
        end = control.look(now, opening(now), is_answered=is_answered(now), is_ended=is_answered(now) and is_ended)
    return end, now


@pytest.mark.parametrize('opening', [0.04, math.nan])
@pytest.mark.parametrize('answered', [0.0, 0.4])
def test_after_an_unanswered_command_it_waits_for_an_answer_and_for_rest(opening, answered):
    end, now = clear(lambda now: opening, lambda now: now > answered)
    assert end is None and now == pytest.approx(answered + REST_TIME, abs=0.03)


def test_a_gripper_without_an_answer_is_silent_and_one_that_moves_on_is_not_stopped():
    end, now = clear(lambda now: 0.04, lambda now: False)
    assert end is Outcome.GRIPPER_SILENT and now == pytest.approx(0.5, abs=0.03)
    end, now = clear(lambda now: 0.04 - 0.001 * now, lambda now: True)  # Here the gripper keeps closing at 1 mm/s.
    assert end is Outcome.NOT_STOPPED and now == pytest.approx(0.5 + REST_LIMIT, abs=0.03)


def test_the_rest_begins_where_the_last_movement_ends():
    end, now = clear(lambda now: 0.04 - 0.005 * min(now, 1.0), lambda now: True)
    assert end is None and 1.0 + REST_TIME - REST_CHANGE / 0.005 - 0.02 <= now <= 1.0 + REST_TIME + 0.02
    sways = clear(lambda now: 0.04 + 0.4 * REST_CHANGE * math.sin(100 * now), lambda now: True)
    # Noise of the position sensor does not count as movement.
    assert sways[0] is None and sways[1] == pytest.approx(REST_TIME, abs=0.03)


@pytest.mark.parametrize(('opening', 'expected', 'after'), [
    (lambda now: 0.04, None, REST_TIME), (lambda now: 0.04 - 0.001 * now, Outcome.NOT_STOPPED, 0.5 + REST_LIMIT),
    (lambda now: math.nan, Outcome.NOT_STOPPED, 0.5 + REST_LIMIT),
    (lambda now: 0.04 if now > 1.0 else math.nan, None, 1.0 + REST_TIME)])
def test_a_gripper_that_refuses_a_cancel_is_at_rest_only_if_the_opening_is_measured(opening, expected, after):
    end, now = clear(opening, lambda now: True, is_ended=False)
    assert end is expected and now == pytest.approx(after, abs=0.03)


def two_sided(force, acquired):
    return TouchReading(acquired, True, GraspContact.TWO_SIDED, (ForceReading(force), ForceReading(force)))


def test_a_goal_to_open_ends_if_the_force_rises_above_its_initial_value():
    widening = Widening(0.08, LIMITS, 0.0, 0.04)
    # A frame acquired before the goal must not set the initial force.
    assert widening.look(0.1, two_sided(50.0, -1.0), 0.04) is None
    assert widening.look(0.2, two_sided(9.0, 0.2), 0.04) is None
    assert widening.look(0.3, two_sided(9.0 + LIMITS.touch_force, 0.3), 0.04) is None
    assert widening.look(0.4, two_sided(9.1 + LIMITS.touch_force, 0.4), 0.04) is Outcome.NOT_OPENING


@pytest.mark.parametrize(('opening', 'travel'), [(0.04, 0.04), (math.nan, 0.08)])
def test_a_goal_to_open_has_the_time_that_its_way_may_need(opening, travel):
    widening = Widening(0.08, LIMITS, 0.0, opening)
    latest = START_TIME + SLOWNESS * travel / LIMITS.fast_speed
    assert widening.look(latest - 0.01, NO_TOUCH, 0.04) is None
    assert widening.look(latest + 0.01, NO_TOUCH, 0.04) is Outcome.TOO_SLOW
