"""Tests of the gripper node between a client, the grasp of the pads, and the gripper's own action.

The tests use both interfaces of control_msgs.
"""

import itertools
import math
import signal
import sys
from collections import deque
from functools import partial

import pytest
from action_msgs.msg import GoalStatus
from gripper_bench import PERIOD, STEP, THRESHOLD
from rclpy.action import CancelResponse

from tactile_node.errors import ConfigurationError
from tactile_node.gripper.duplicate_watch import LISTEN_TIME
from tactile_node.gripper.gripper_node import LOOK_PERIOD
from tactile_node.gripper.messages import Command
from tactile_node.gripper.rules.closing import REST_TIME, SLOWNESS, START_TIME, Outcome, TouchLimits
from tactile_skin.msg import Grasp, GripperOutcome

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.usefixtures('control_msgs')]

LIMITS = TouchLimits()
MAX_AGE = LIMITS.max_age
#: Increase in the force between two frames [N].
FAST_RISE = LIMITS.fast_speed * PERIOD * LIMITS.stiffness
SLOW_RISE = LIMITS.slow_speed * PERIOD * LIMITS.stiffness
# Largest travel from the last seen frame until the gripper stops [m].
BLIND_TRAVEL = LIMITS.fast_speed * (MAX_AGE + LOOK_PERIOD + STEP)
SILENT = None
SUCCEEDED, ABORTED, CANCELED = GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_ABORTED, GoalStatus.STATUS_CANCELED
KINDS = ['ParallelGripperCommand', 'GripperCommand']
LONG = pytest.mark.long


@pytest.fixture
def make_bench(ros):
    from gripper_bench import GripperBench
    return partial(GripperBench, ros)


def set_(**fields):
    """Return a function that sets ``fields`` of a grasp message."""
    def change(message):
        for name, value in fields.items():
            setattr(message, name, value)
        return message
    return change


def unseen(message):
    return set_(contact=Grasp.UNSEEN, side_states=[Grasp.SIDE_UNSEEN, message.side_states[1]],
                forces=[math.nan, message.forces[1]])(message)


def test_the_outcomes_of_the_message_are_those_of_the_code():
    assert {each.name: getattr(GripperOutcome, each.name) for each in Outcome} == {
        each.name: int(each) for each in Outcome}


def test_messages_sent_in_a_step_arrive_before_its_end(make_bench):
    """If messages arrived after the end of their step, the durations in these tests would not be exact."""
    bench = make_bench()
    bench.client.send(position=0.0)
    received, first = bench.node._grasps.counts.received, bench.motor.opening
    for frames in range(1, 20):
        bench.wait(PERIOD)
        assert bench.node._grasps.counts.received == received + frames
        assert bench.node._client.opening(STEP / 2) == bench.motor.opening < first


@pytest.mark.parametrize(('kind', 'stop_by'), [
    (KINDS[0], 'cancel'), (KINDS[1], 'goal'), pytest.param(KINDS[0], 'goal', marks=LONG),
    pytest.param(KINDS[1], 'cancel', marks=LONG)])
def test_a_goal_without_effort_ends_when_both_pads_are_touched(make_bench, kind, stop_by):
    bench = make_bench(kind, {'stop_by': stop_by})
    status, state, outcome = bench.close(position=0.0)
    assert (status, outcome.outcome, state.stalled, state.reached_goal) == (SUCCEEDED, Outcome.TOUCHED, True, False)
    before = bench.motor.opening
    bench.wait(0.3)
    assert bench.motor.opening == pytest.approx(before, abs=2e-4)  # The gripper must hold its position.
    assert state.position == pytest.approx(before, abs=1e-3) and outcome.opening == pytest.approx(before, abs=1e-3)
    assert THRESHOLD < bench.pads.strongest <= THRESHOLD + FAST_RISE
    assert bench.motor.cancels == (stop_by == 'cancel')


@pytest.mark.parametrize('kind', KINDS)
def test_a_goal_with_an_effort_ends_at_that_force_and_closes_slowly_after_the_touch(make_bench, kind):
    bench = make_bench(kind)
    status, state, outcome = bench.close(position=0.0, effort=5.0)
    assert (status, outcome.outcome, state.stalled) == (SUCCEEDED, Outcome.FORCE_REACHED, True)
    assert 5.0 <= state.effort <= bench.pads.strongest <= 5.0 + (SLOW_RISE if kind == KINDS[0] else FAST_RISE)
    assert list(outcome.forces) == [state.effort] * 2
    if kind == 'ParallelGripperCommand':
        assert [each.speed for each in bench.motor.commands] == pytest.approx([LIMITS.fast_speed, LIMITS.slow_speed])
    # The node sends the gripper's own effort limit, never the effort of the client.
    assert {each.effort for each in bench.motor.commands} == {10.0}


def test_a_gripper_in_radians_that_close_it_is_commanded_in_radians(make_bench):
    bench = make_bench('GripperCommand', scale=-0.1, offset=0.08)
    bench.motor.move_to(0.06)
    status, state, outcome = bench.close(position=0.8)
    assert outcome.outcome == Outcome.TOUCHED and outcome.opening == pytest.approx(0.039, abs=2e-3)
    assert state.position == pytest.approx((outcome.opening - 0.08) / -0.1, abs=1e-6)
    assert [each.position for each in bench.motor.commands] == pytest.approx([0.8])
    assert bench.close(position=0.0)[2].outcome == Outcome.REACHED and bench.motor.opening == pytest.approx(0.08)


def test_the_gripper_reaches_its_goal_without_an_object(make_bench):
    bench = make_bench(pads={'width': 0.0})
    status, state, outcome = bench.close(position=0.03)
    assert (status, outcome.outcome, state.stalled, state.reached_goal) == (SUCCEEDED, Outcome.REACHED, False, True)
    assert bench.motor.opening == pytest.approx(0.03)


NOT_SEEN = [unseen, set_(fresh=False), SILENT, set_(gap_source=77)]  # The last change makes the message malformed.


def hide(bench, change):
    bench.pads.is_silent = change is SILENT
    bench.pads.change = change or bench.pads.change


# test_gripper_health.py refuses to close with each of these changes.
@pytest.mark.parametrize('change', [unseen, *(pytest.param(each, marks=LONG) for each in NOT_SEEN[1:])])
def test_a_gripper_does_not_close_but_opens_while_a_pad_is_not_seen(make_bench, change):
    bench = make_bench()
    hide(bench, change)
    bench.wait(MAX_AGE + PERIOD)
    status, _, outcome = bench.close(position=0.0)
    assert (status, outcome.outcome, bench.motor.commands) == (ABORTED, Outcome.NOT_SEEN, [])
    status, _, outcome = bench.close(position=0.08)
    assert (status, outcome.outcome, bench.motor.opening) == (SUCCEEDED, Outcome.REACHED, 0.08)


@pytest.mark.parametrize('change', NOT_SEEN)
def test_the_gripper_stops_and_holds_when_a_pad_is_no_longer_seen(make_bench, change):
    bench = make_bench()
    handle = bench.client.send(position=0.0)
    bench.wait(0.1)
    before = bench.motor.opening
    hide(bench, change)
    status, _, outcome = bench.client.result(handle)
    stopped = bench.motor.opening
    assert (status, outcome.outcome) == (ABORTED, Outcome.NOT_SEEN)
    assert before < 0.06 and 0 < before - stopped <= BLIND_TRAVEL
    bench.wait(0.1)
    assert bench.motor.opening == stopped


@pytest.mark.parametrize(('kind', 'stop_by'), [(KINDS[1], 'goal'), pytest.param(KINDS[0], 'cancel', marks=LONG)])
def test_the_gripper_rests_while_a_pad_is_briefly_unseen(make_bench, kind, stop_by):
    bench = make_bench(kind, {'stop_by': stop_by})
    handle = bench.client.send(position=0.0)
    bench.wait(0.3)
    seen = bench.pads.change
    bench.pads.change = unseen
    bench.until(lambda: not bench.motor.moves)
    stopped = bench.motor.opening
    bench.wait(0.1)
    assert 0.0 < stopped < 0.06 and bench.motor.opening == stopped
    bench.pads.change = seen
    _, _, outcome = bench.client.result(handle)
    assert outcome.outcome == Outcome.TOUCHED and bench.motor.opening < stopped


def test_occasional_unseen_frames_do_not_stop_the_gripper(make_bench):
    bench = make_bench()
    is_unseen = itertools.cycle([True, False, False])
    bench.pads.change = lambda message: unseen(message) if next(is_unseen) else message
    assert bench.close(position=0.0)[2].outcome == Outcome.TOUCHED


def test_a_possibly_larger_force_stops_the_gripper(make_bench):
    """Each change makes a pad saturated, partly hidden, on/off or not seen, or makes its force a lower bound."""
    bench = make_bench()
    for change in (set_(saturated_taxels=[1, 0]), set_(hidden_taxels=[0, 2]), set_(forces=[math.nan, 0.2]),
                   set_(force_is_bound=[True, False]), set_(pads_seen=[True, False])):
        bench.open()
        bench.motor.move_to(0.045)
        bench.pads.change = lambda message, change=change: change(message) if message.contact > 2 else message
        status, _, outcome = bench.close(position=0.0, effort=10.0)
        assert (status, outcome.outcome) == (ABORTED, Outcome.FORCE_NOT_KNOWN)
        assert bench.pads.strongest <= THRESHOLD + FAST_RISE


def test_a_second_publisher_of_grasp_is_not_used(make_bench):
    bench = make_bench()
    bench.add('other').create_publisher(Grasp, '/grasp', 10)
    bench.until_joined(lambda: bench.node.count_publishers('/grasp') == 2)
    bench.wait(0.1)
    assert bench.close(position=0.0)[2].outcome == Outcome.NOT_SEEN and not bench.motor.commands


def test_one_pad_that_pushes_stops_it_at_the_limit(make_bench):
    bench = make_bench(pads={'off': 0.01})
    status, state, outcome = bench.close(position=0.0)
    assert (status, outcome.outcome, state.stalled) == (ABORTED, Outcome.ONE_SIDED, False)
    assert LIMITS.touch_force <= bench.pads.strongest <= LIMITS.touch_force + SLOW_RISE


def test_an_object_that_is_lost_while_it_closes_on_it(make_bench):
    bench = make_bench(pads={'stiffness': 100.0})
    handle = bench.client.send(position=0.0, effort=15.0)
    bench.until(lambda: min(bench.pads.forces()) > 0.2)
    bench.pads.width = 0.0
    assert bench.client.result(handle)[2].outcome == Outcome.LOST and bench.motor.opening > 0.02


def test_a_cancelled_goal_stops_the_gripper(make_bench):
    bench = make_bench()
    handle = bench.client.send(position=0.0)
    bench.wait(0.3)
    handle.cancel()
    status, _, outcome = bench.client.result(handle)
    assert (status, outcome.outcome, bench.motor.moves) == (CANCELED, Outcome.CANCELED, False)


def test_a_later_goal_of_another_client_replaces_the_one_before(make_bench):
    from gripper_bench import Client
    bench = make_bench()
    other = Client(bench, bench.interface)
    other.until_ready()
    first = bench.client.send(position=0.0)
    bench.wait(0.2)
    second = other.send(position=0.08)
    status, _, outcome = bench.client.result(first)
    assert (status, outcome.outcome) == (ABORTED, Outcome.REPLACED)
    assert other.result(second)[2].outcome == Outcome.REACHED and bench.motor.opening == pytest.approx(0.08)


def press(bench, force):
    """Move the gripper until both pads read ``force`` [N], before any goal is sent."""
    bench.motor.move_to(bench.pads.width - force / 1000.0)
    bench.wait(0.2)
    bench.motor.commands.clear()


def test_pads_that_already_press_with_more_than_the_goal_end_it_and_nothing_is_sent(make_bench):
    bench = make_bench(parameters={'hold': True})
    press(bench, 9.2)
    bench.motor.die()
    status, state, outcome = bench.close(position=0.0, effort=2.0)
    assert (status, outcome.outcome, state.stalled) == (ABORTED, Outcome.ALREADY_PRESSED, False)
    assert '7.2 N more than the 2 N' in outcome.message
    bench.pads.width -= 0.009
    bench.wait(1.0)
    # The gripper is dead, so a hold would already have ended.
    assert not any(each.of_hold for each in bench.client.outcomes)


def test_a_late_command_is_followed_by_a_goal_to_hold_if_a_cancel_does_not_stop(make_bench):
    bench = make_bench(parameters={'stop_by': 'goal'})
    bench.motor.coasts = True
    bench.motor.fall_silent()
    assert bench.close(position=0.0)[2].outcome == Outcome.GRIPPER_SILENT
    bench.motor.wake()
    bench.until(lambda: bench.motor.directions[-1:] == ['hold'])
    held_at = bench.motor.opening
    bench.wait(1.0)
    assert bench.motor.opening == pytest.approx(held_at, abs=1e-3)


def test_a_cancel_without_an_answer_is_sent_again_until_there_is_one(make_bench):
    """The middleware stops sending to a stopped process.

    Without a repeated cancel, the gripper would close for seconds once its process continues.
    """
    bench, asked = make_bench(), []
    goal = bench.client.send(position=0.0)
    bench.until(lambda: bench.motor.moves)
    bench.motor.fall_silent()
    bench.motor.rejects = True  # The gripper rejects the goal to hold, so that the first goal can still be cancelled.
    bench.motor.server.register_cancel_callback(lambda handle: asked.append(handle) or CancelResponse.REJECT)
    goal.cancel()
    assert bench.client.result(goal)[2].outcome == Outcome.NOT_STOPPED
    bench.wait(1.0)
    bench.motor.wake()
    bench.wait(0.5)
    answered = len(asked)
    bench.wait(1.0)
    assert 3 < answered == len(asked)


def test_a_command_that_one_server_rejects_is_cancelled_at_another_that_accepts_it_later(make_bench):
    """One server is stopped, and another server answers.

    When the stopped server continues, the goal is still in its queue.
    """
    bench = make_bench()
    stopped = bench.motor.node
    bench.motor.fall_silent()
    bench.motor.restart()
    bench.motor.rejects = True
    assert bench.close(position=0.0)[2].outcome == Outcome.GRIPPER_REFUSED
    bench.motor.rejects = False
    bench.executor.add_node(stopped)
    bench.until(lambda: bench.motor.cancels)
    assert not bench.motor.moves and bench.motor.opening > bench.pads.width


def test_a_goal_to_open_partly_opens_after_a_server_was_lost_at_the_touch(make_bench):
    """While the gripper may still be moving, the node guards this goal like a goal to close.

    A goal to close to this opening would count as done at the first check.
    """
    bench = make_bench()
    handle = bench.client.send(position=0.0)
    bench.until(lambda: min(bench.pads.forces()) > 0)
    bench.motor.fall_silent()
    assert bench.client.result(handle)[2].outcome == Outcome.NOT_STOPPED
    bench.motor.restart()
    assert bench.close(position=0.05)[2].outcome == Outcome.REACHED
    assert bench.motor.opening == pytest.approx(0.05)


def test_a_force_within_the_overshoot_is_reached_and_the_text_states_the_excess(make_bench):
    bench = make_bench()
    for force, effort, text in ((2.5, 2.0, '0.5 N more than the 2 N'), (2.0, 2.0, '')):
        press(bench, force)
        status, _, outcome = bench.close(position=0.0, effort=effort)
        assert (status, outcome.outcome, bench.motor.commands) == (SUCCEEDED, Outcome.FORCE_REACHED, [])
        assert text in outcome.message and ('more than' in outcome.message) == bool(text)


#: States of the pads in which a goal to open is sent.
PADS = [lambda message: message, *NOT_SEEN]


@pytest.mark.parametrize(('opening', 'first'), [
    (LIMITS.widest, 0), (LIMITS.widest + 0.005, 2),
    *(pytest.param(opening, first, marks=LONG) for opening, firsts in (
        (LIMITS.widest, (1, 2, 3, 4)), (LIMITS.widest + 0.005, (0, 1, 3, 4))) for first in firsts)])
def test_a_goal_to_open_to_the_widest_is_always_sent(make_bench, opening, first):
    """The node sends the goal even if the pads are pressed or not seen, and even with numbers refused for closing.

    The first goal meets the pads in the state PADS[``first``], and each later goal meets the next state. With
    TACTILE_LONG, each goal meets each state.
    """
    bench = make_bench()
    bench.motor.slowness = 0.1  # A fast gripper suffices, because only the sent commands matter.
    several = bench.interface.goal(Command(opening, 1.0, 1.0))
    several.command.velocity, several.command.effort = [1.0, 1.0], [1.0, 1.0]
    goals = ({}, {'speed': -1.0}, {'speed': math.nan}, {'speed': 99.0}, {'effort': math.nan}, {'effort': 1e9},
             {'effort': -1.0}, {'goal': several})
    for goal, change in zip(goals, itertools.islice(itertools.cycle(PADS), first, None)):
        bench.pads.change, bench.pads.is_silent = PADS[0], False
        press(bench, 9.0)
        hide(bench, change)
        bench.wait(MAX_AGE + PERIOD)
        status, _, outcome = bench.close(**{'position': opening, **goal})
        assert (status, outcome.outcome) == (SUCCEEDED, Outcome.REACHED), goal
        assert [each.position for each in bench.motor.commands] == pytest.approx([opening])


def test_pads_that_are_seen_to_press_only_while_it_opens_do_not_stop_it(make_bench):
    """The last reading before the pads went blind must not count as the initial force."""
    bench = make_bench()
    bench.pads.is_silent = True
    bench.wait(MAX_AGE + PERIOD)
    bench.motor.move_to(bench.pads.width - 0.009)
    handle = bench.client.send(position=LIMITS.widest)
    bench.wait(2 * STEP)
    bench.pads.is_silent = False
    assert bench.client.result(handle)[2].outcome == Outcome.REACHED


def test_a_goal_that_cannot_be_used_is_refused_with_a_reason_and_changes_nothing(make_bench):
    bench = make_bench()
    two_joints = bench.interface.action.Goal()
    two_joints.command.position = [0.0, 0.0]
    first = bench.client.send(position=0.0)
    for bad in ({'effort': -1.0}, {'effort': math.nan}, {'effort': 1000.0}, {'position': math.nan}, {'position': -0.5},
                {'position': math.inf}, {'speed': -0.1}, {'speed': 0.2}, {'goal': two_joints}):
        status, _, outcome = bench.close(**{'position': 0.01, **bad})
        assert (status, outcome.outcome) == (ABORTED, Outcome.REFUSED) and 'expected' in outcome.message
    assert bench.client.result(first)[2].outcome == Outcome.TOUCHED


@pytest.mark.parametrize(('fault', 'expected'), [
    (lambda bench: setattr(bench.motor, 'rejects', True), Outcome.GRIPPER_REFUSED),
    (lambda bench: bench.motor.die(), Outcome.NO_GRIPPER),
    (lambda bench: bench.motor.fall_silent(), Outcome.GRIPPER_SILENT)],
    ids=['rejects', 'dead', 'silent'])
def test_a_gripper_that_does_not_accept_the_command(make_bench, fault, expected):
    bench = make_bench()
    fault(bench)
    bench.wait(0.2)
    status, _, outcome = bench.close(position=0.0)
    assert (status, outcome.outcome) == (ABORTED, expected)


def test_a_gripper_that_dies_while_it_closes(make_bench):
    bench = make_bench()
    handle = bench.client.send(position=0.0)
    bench.wait(0.3)
    bench.motor.die()
    status, _, outcome = bench.client.result(handle)
    assert (status, outcome.outcome) == (ABORTED, Outcome.NO_GRIPPER)


def test_a_gripper_that_stalls_by_itself(make_bench):
    bench = make_bench(pads={'width': 0.0})
    bench.motor.blocked_at = 0.05
    status, state, outcome = bench.close(position=0.0)
    assert (status, outcome.outcome, state.stalled) == (ABORTED, Outcome.STALLED, True)


def test_a_gripper_that_is_far_too_slow(make_bench):
    bench = make_bench()
    bench.motor.slowness = 1000.0
    began = bench.steady()
    assert bench.close(position=0.05)[2].outcome == Outcome.TOO_SLOW
    late = bench.steady() - began - (START_TIME + SLOWNESS * 0.01 / LIMITS.fast_speed)
    assert 0 < late < LOOK_PERIOD + 5 * STEP  # The goal, the stop and the result take one STEP each.


def test_a_gripper_that_a_cancel_does_not_stop_gets_a_goal_at_its_opening(make_bench):
    bench = make_bench()
    bench.motor.stays = True
    outcome = bench.close(position=0.0)[2].outcome
    bench.wait(0.1)
    assert outcome == Outcome.TOUCHED and bench.motor.opening == pytest.approx(bench.motor.commands[-1].position)


@pytest.mark.parametrize('stop_by', ['cancel', pytest.param('goal', marks=LONG)])
def test_a_gripper_that_takes_one_goal_at_a_time_is_stopped_by_a_cancel(make_bench, stop_by):
    """While its first command is active, the gripper rejects a slower speed at the first touch and a goal to hold."""
    bench = make_bench(parameters={'stop_by': stop_by})
    bench.motor.most_goals = 1
    status, _, outcome = bench.close(position=0.0, effort=10.0)
    assert (status, outcome.outcome, bench.motor.moves) == (ABORTED, Outcome.GRIPPER_REFUSED, False)
    assert bench.pads.strongest <= THRESHOLD + 2 * FAST_RISE


def test_an_empty_result_gives_no_opening(make_bench):
    """An empty result has the position 0.0, which would turn the next goal to close into a goal to open."""
    bench = make_bench('GripperCommand')
    bench.pads.knows_gap, bench.motor.is_terse = False, True
    handle = bench.client.send(position=0.0)
    bench.wait(0.2)
    handle.cancel()
    assert bench.client.result(handle)[2].outcome == Outcome.CANCELED
    assert bench.close(position=0.03)[2].outcome == Outcome.TOUCHED and bench.pads.strongest <= THRESHOLD + FAST_RISE


def test_a_gripper_wider_than_widest_is_not_closed_by_a_goal_to_open(make_bench):
    bench = make_bench(pads={'width': 0.1})
    bench.motor.move_to(0.14)
    bench.wait(0.1)
    assert bench.close(position=0.09)[2].outcome == Outcome.TOUCHED and bench.motor.opening > 0.09
    bench.pads.change = unseen
    assert bench.close(position=0.13)[2].outcome == Outcome.REACHED and bench.motor.opening == pytest.approx(0.13)


def test_a_goal_between_while_it_opens_is_guarded(make_bench):
    """When the gripper receives the goal, the jaws may be further open than at the last reading."""
    bench = make_bench()
    bench.pads.change = unseen
    bench.wait(MAX_AGE + PERIOD)
    bench.client.send(position=0.08)
    bench.wait(0.1)
    assert bench.close(position=0.065)[2].outcome == Outcome.NOT_SEEN and not bench.motor.moves


def listen_anew(bench, left):
    """Make the node listen for other gripper nodes for another ``left`` [s], as if its process had been paused."""
    bench.node._watch._listens_since = bench.steady() - LISTEN_TIME + left


def test_a_goal_that_waited_while_it_opened_is_guarded(make_bench):
    """The goal to open was replaced, but the gripper has not yet confirmed the end of its command."""
    bench = make_bench()
    bench.motor.stays = True
    bench.pads.change = unseen
    bench.wait(MAX_AGE + PERIOD)
    bench.client.send(position=0.08)
    bench.wait(0.1)
    listen_anew(bench, 2 * STEP)
    assert bench.close(position=0.065)[2].outcome == Outcome.NOT_SEEN
    bench.wait(0.1)
    assert bench.motor.opening < 0.064 and not bench.motor.moves


def test_a_goal_that_waits_for_a_gripper_that_never_ends_its_command_is_not_stopped(make_bench):
    """The gripper accepts the goal to hold, but never reports the end of the replaced command."""
    bench = make_bench()
    bench.motor.stays = bench.motor.never_ends = True
    bench.client.send(position=0.0)
    bench.wait(0.2)
    listen_anew(bench, LISTEN_TIME)
    assert bench.close(position=0.07)[2].outcome == Outcome.NOT_STOPPED


def never_ends(make_bench, **parameters):
    """Return a bench whose gripper refuses to cancel a command to close.

    This gripper holds on request, but never ends a replaced command.
    """
    bench = make_bench(parameters=parameters)
    handle = bench.client.send(position=0.0)
    bench.wait(0.2)
    bench.motor.stays = bench.motor.never_ends = True
    handle.cancel()
    _, _, outcome = bench.client.result(handle)
    assert outcome.outcome == Outcome.NOT_STOPPED and 'may still be moving' in outcome.message
    bench.motor.commands.clear()
    return bench


def test_a_gripper_that_never_ends_a_command_closes_again_once_it_was_measured_at_rest(make_bench):
    bench = never_ends(make_bench)
    began = bench.steady()
    sent = bench.client.send(position=0.0)
    bench.until(lambda: bench.motor.commands)
    assert bench.steady() - began >= REST_TIME
    bench.motor.stays = bench.motor.never_ends = False
    assert bench.client.result(sent)[2].outcome == Outcome.TOUCHED


def test_a_gripper_that_never_ends_a_command_and_moves_does_not_close_again(make_bench):
    bench = never_ends(make_bench)
    bench.motor._target = 0.04  # The hardware keeps moving to this opening.
    bench.motor._speed = 0.003
    _, _, outcome = bench.close(position=0.0)
    assert outcome.outcome == Outcome.NOT_STOPPED and not bench.motor.commands


def test_a_gripper_that_never_ends_a_command_closes_only_after_a_restart_where_it_is_not_measured(make_bench):
    bench = never_ends(make_bench)
    bench.pads.knows_gap = False
    bench.wait(MAX_AGE + PERIOD)
    for _ in range(2):
        _, _, outcome = bench.close(position=0.0)
        assert outcome.outcome == Outcome.NOT_STOPPED and not bench.motor.commands
        assert 'refuses to cancel' in outcome.message and 'restart' in outcome.message
    assert bench.close(position=LIMITS.widest)[2].outcome == Outcome.REACHED
    bench.motor.kill()
    bench.motor.restart()
    bench.motor.stays = bench.motor.never_ends = False
    assert bench.close(position=0.0)[2].outcome == Outcome.TOUCHED


@pytest.mark.parametrize('kind', [KINDS[0], pytest.param(KINDS[1], marks=LONG)])
def test_a_gripper_that_reports_success_early_stays_under_guard(make_bench, kind):
    """The controllers of ros2_control report success early, because their default goal_tolerance is 10 mm."""
    bench = make_bench(kind)
    bench.motor.is_hasty = True
    assert bench.close(position=0.0)[2].outcome == Outcome.TOUCHED
    bench.wait(0.3)
    assert bench.pads.strongest <= THRESHOLD + FAST_RISE


@pytest.mark.parametrize(('position', 'blocked_at'), [(0.0, 0.05), (LIMITS.widest, 0.06)])
def test_a_gripper_that_reports_success_but_rests_elsewhere_has_failed(make_bench, position, blocked_at):
    bench = make_bench(pads={'width': 0.0})
    bench.motor.is_hasty, bench.motor.blocked_at = True, blocked_at
    if position:
        bench.motor.slowness = 1e9
    status, state, outcome = bench.close(position=position)
    assert (status, outcome.outcome, state.reached_goal) == (ABORTED, Outcome.GRIPPER_FAILED, False)
    assert f'measured opening is {1e3 * abs(bench.motor.opening - position):.0f} mm' in outcome.message


def test_a_report_of_success_is_trusted_if_the_opening_is_not_measured(make_bench):
    bench = make_bench(pads={'width': 0.0})
    bench.pads.knows_gap = False
    bench.wait(MAX_AGE + PERIOD)
    bench.motor.is_hasty = True
    assert bench.close(position=0.03)[2].outcome == Outcome.REACHED


@pytest.mark.parametrize('stop_by', ['cancel', pytest.param('goal', marks=LONG)])
def test_a_gripper_that_reported_success_early_is_stopped_at_its_opening(make_bench, stop_by):
    """A cancel would find no command, so a goal stops the gripper.

    A node that is shut down stops the gripper in the same way.
    """
    bench = make_bench(parameters={'stop_by': stop_by})
    bench.motor.is_hasty = True
    handle = bench.client.send(position=0.0)
    bench.wait(0.2)
    handle.cancel()
    assert bench.client.result(handle)[2].outcome == Outcome.CANCELED
    stopped = bench.motor.opening
    bench.client.send(position=0.0)
    bench.wait(0.2)
    bench.node.destroy_node()
    bench.wait(0.3)
    assert bench.motor.directions == ['close', 'hold', 'close', 'hold'] and 0.05 < bench.motor.opening < stopped


def test_an_opening_gripper_that_stalls_or_presses_has_not_succeeded(make_bench):
    bench = make_bench()
    bench.close(position=0.0)
    bench.motor.slowness = 1e9
    handle = bench.client.send(position=0.08)
    bench.wait(0.1)
    bench.motor._end(bench.motor._goal.abort, stalled=True)
    status, _, outcome = bench.client.result(handle)
    assert (status, outcome.outcome) == (ABORTED, Outcome.STALLED)
    handle = bench.client.send(position=0.08)
    bench.wait(0.1)
    bench.pads.width += 0.01  # A wrong sign of gap_scale would have this effect.
    status, _, outcome = bench.client.result(handle)
    assert (status, outcome.outcome) == (ABORTED, Outcome.NOT_OPENING)


def test_a_cancel_that_is_not_confirmed_is_not_reported_as_done(make_bench):
    bench = make_bench(parameters={'answer_timeout': 0.2})
    handle = bench.client.send(position=0.0)
    bench.wait(0.2)
    bench.motor.fall_silent()
    handle.cancel()
    status, _, outcome = bench.client.result(handle)
    assert (status, outcome.outcome) == (ABORTED, Outcome.NOT_STOPPED)


def test_a_partial_opening_needs_a_measured_one_or_is_guarded(make_bench):
    """A gap from a parameter may be outdated, so a goal that seems to open the gripper may close it."""
    bench = make_bench()
    bench.pads.change = lambda message: unseen(set_(gap=0.03, gap_source=Grasp.GAP_PARAMETER)(message))
    bench.wait(MAX_AGE + PERIOD)
    assert bench.close(position=0.05)[2].outcome == Outcome.NOT_SEEN and not bench.motor.commands
    bench.pads.change = unseen
    bench.motor.move_to(0.03)
    bench.wait(0.1)
    assert bench.close(position=0.05)[2].outcome == Outcome.REACHED


def test_an_opening_that_was_held_back_on_its_way_is_not_the_present_one(make_bench):
    """With the outdated opening, a goal to close would count as a goal to open, which nothing guards."""
    bench, held = make_bench(pads={'width': 0.0}), deque()
    bench.motor.move_to(0.03)

    def hold_back(message):
        held.append(message)
        return held.popleft() if len(held) > 2 * MAX_AGE / PERIOD else held[0]
    bench.wait(1.0)
    bench.pads.change = hold_back
    bench.wait(0.5)
    bench.motor.move_to(0.06)
    bench.wait(MAX_AGE)
    assert bench.close(position=0.05)[2].outcome == Outcome.NOT_SEEN and not bench.motor.commands


def test_the_opening_from_two_publishers_of_grasp_is_not_used(make_bench):
    bench = make_bench(pads={'width': 0.0})
    bench.add('other').create_publisher(Grasp, '/grasp', 10)
    bench.until_joined(lambda: bench.node.count_publishers('/grasp') == 2)
    bench.wait(MAX_AGE + PERIOD)
    assert bench.close(position=0.065)[2].outcome == Outcome.NOT_SEEN and not bench.motor.commands


def test_a_node_that_ends_stops_the_gripper(make_bench):
    bench = make_bench()
    bench.client.send(position=0.0)
    bench.wait(0.3)
    bench.node.destroy_node()
    before = bench.motor.opening
    bench.wait(0.4)
    assert before - bench.motor.opening <= LIMITS.fast_speed * 2 * STEP and bench.motor.cancels


@pytest.mark.parametrize('wrong', [{'action_type': 'Grip'}, {'stop_by': 'luck'}, {'fast_speed': 0.5},
                                   {'gap_scale': 0.0}])
def test_a_wrong_parameter_is_one_error(make_bench, wrong):
    with pytest.raises(ConfigurationError, match=next(iter(wrong)).split('_')[-1]):
        make_bench(parameters=wrong)


def test_without_control_msgs_the_error_names_it(make_bench, monkeypatch):
    monkeypatch.setitem(sys.modules, 'control_msgs', None)
    with pytest.raises(ConfigurationError, match='control_msgs'):
        make_bench()


@LONG
def test_killed_in_mid_close_the_gripper_has_a_safe_command(make_bench):
    """After SIGKILL, the gripper keeps its last command, which includes the gripper's own effort limit.

    The tests in virtual time check this limit in all commands.
    """
    bench = make_bench(has_node=False)
    with bench.node_as_process() as process:
        bench.client.send(position=0.0)
        bench.until(lambda: bench.motor.commands)
        process.send_signal(signal.SIGKILL)
        process.wait()
        bench.wait(0.2)
        assert bench.motor.moves and {each.effort for each in bench.motor.commands} == {10.0}
