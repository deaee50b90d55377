"""Tests of the gripper node between a client, the grasp of the pads, and the gripper's own action.

The tests use both interfaces of control_msgs. test_control.py and test_control_hold.py test the rules of the node
without ROS.
"""

import math
import signal
import sys
from collections import deque
from functools import partial

import pytest
from action_msgs.msg import GoalStatus
from rclpy.action import CancelResponse
from rclpy.parameter import Parameter
from virtual_gripper import PERIOD, STEP, THRESHOLD

from tactile_node.errors import ConfigurationError
from tactile_node.gripper.gripper_node import GripperNode
from tactile_node.gripper.messages import touch_of
from tactile_node.gripper.rules.closing import Outcome
from tactile_node.gripper.rules.touch_settings import TouchSettings
from tactile_skin.msg import ContactMotion, Grasp

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.usefixtures('control_msgs')]

LIMITS = TouchSettings()
MAX_AGE = LIMITS.max_age
#: Increase in the force between two frames [N].
FAST_RISE = LIMITS.fast_speed * PERIOD * LIMITS.stiffness
SLOW_RISE = LIMITS.slow_speed * PERIOD * LIMITS.stiffness
SHRINKS = 0.0015  # Decrease in an object's width [m], which reduces the force by 1.5 N.
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


def test_messages_sent_in_a_step_arrive_before_its_end(make_bench):
    """If messages arrived after the end of their step, the durations in these tests would not be exact."""
    bench = make_bench()
    bench.client.send(position=0.0)
    received, first = bench.node._grasps.counts.received, bench.motor.opening
    for frames in range(1, 20):
        bench.wait(PERIOD)
        assert bench.node._grasps.counts.received == received + frames
        assert bench.node._control.commands.opening(STEP / 2) == bench.motor.opening < first


@pytest.mark.parametrize(('kind', 'stop_by'), [(KINDS[0], 'cancel'), (KINDS[1], 'goal')])
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


def two_sided(**fields):
    """Return a grasp message of two pads that read 2 N each, with ``fields``."""
    return set_(**{'contact': Grasp.TWO_SIDED, 'fresh': True, 'forces': [2.0, 2.0], 'pads_seen': [True, True],
                   **fields})(Grasp())


def test_a_grasp_has_a_known_force_unless_taxels_hide_it():
    seen = touch_of(two_sided(force_is_bound=[True, False], at_edge=[True, False]), 5.0)
    assert seen.is_current(5.1, MAX_AGE) and seen.has_force and seen.pads[0].is_bound and not seen.pads[1].is_bound
    for hides in ({'saturated_taxels': [1, 0]}, {'hidden_taxels': [0, 2]}, {'forces': [math.nan, 0.2]},
                  {'force_is_bound': [True, False]}, {'pads_seen': [True, False]}):
        assert not touch_of(two_sided(**hides), 5.0).has_force, hides


def test_a_grasp_has_a_direction_of_a_slide_only_while_a_pad_reports_one():
    motions = [ContactMotion(moving=ContactMotion.SLIDING | ContactMotion.TURNING, direction=1.0),
               ContactMotion(moving=ContactMotion.SHIFTING | ContactMotion.TURNING, direction=2.0)]
    left, right = touch_of(two_sided(motions=motions), 5.0).slides
    assert left == 1.0 and math.isnan(right)


def test_a_goal_to_the_widest_is_sent_even_with_several_speeds_and_efforts(make_bench):
    bench = make_bench()
    bench.pads.change = unseen
    several = bench.interface.action.Goal()
    several.command.position, several.command.velocity, several.command.effort = [LIMITS.widest], [1.0] * 2, [1.0] * 2
    assert bench.close(goal=several)[2].outcome == Outcome.REACHED
    assert [each.position for each in bench.motor.commands] == [LIMITS.widest]


def test_a_cancelled_goal_stops_the_gripper(make_bench):
    bench = make_bench()
    handle = bench.client.send(position=0.0)
    bench.wait(0.3)
    handle.cancel()
    status, _, outcome = bench.client.result(handle)
    assert (status, outcome.outcome, bench.motor.moves) == (CANCELED, Outcome.CANCELED, False)


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


def test_a_goal_that_cannot_be_used_is_refused_with_a_reason_and_changes_nothing(make_bench):
    bench = make_bench()
    two_joints = bench.interface.action.Goal()
    two_joints.command.position = [0.0, 0.0]
    first = bench.client.send(position=0.0)
    for bad in ({'effort': -1.0}, {'position': math.nan}, {'goal': two_joints}):
        status, _, outcome = bench.close(**{'position': 0.01, **bad})
        assert (status, outcome.outcome) == (ABORTED, Outcome.REFUSED) and 'expected' in outcome.message
    assert bench.client.result(first)[2].outcome == Outcome.TOUCHED


def test_a_gripper_that_dies_while_it_closes(make_bench):
    bench = make_bench()
    handle = bench.client.send(position=0.0)
    bench.wait(0.3)
    bench.motor.die()
    status, _, outcome = bench.client.result(handle)
    assert (status, outcome.outcome) == (ABORTED, Outcome.NO_GRIPPER)
    assert 'no server offers /gripper_controller/gripper_cmd' in outcome.message


def test_an_empty_result_gives_no_opening(make_bench):
    """An empty result has the position 0.0, which would turn the next goal to close into a goal to open."""
    bench = make_bench('GripperCommand')
    bench.pads.knows_gap, bench.motor.is_terse = False, True
    handle = bench.client.send(position=0.0)
    bench.wait(0.2)
    handle.cancel()
    assert bench.client.result(handle)[2].outcome == Outcome.CANCELED
    assert bench.close(position=0.03)[2].outcome == Outcome.TOUCHED and bench.pads.strongest <= THRESHOLD + FAST_RISE


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
                                   {'gap_scale': 0.0}, {'latency': math.nan}, {'edge_share': 1.1}])
def test_a_wrong_parameter_is_one_error(ros, wrong):
    (name, value), = wrong.items()
    with pytest.raises(ConfigurationError, match=name.split('_')[-1]):
        GripperNode(parameter_overrides=[Parameter(name, value=value)])


def test_without_control_msgs_the_error_names_it(ros, monkeypatch):
    monkeypatch.setitem(sys.modules, 'control_msgs', None)
    with pytest.raises(ConfigurationError, match='control_msgs'):
        GripperNode()


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


def hold(bench):
    """Close from a short distance until the gripper holds, and return the goal."""
    bench.motor.move_to(bench.pads.width + 0.001)
    bench.wait(0.2)
    sent = bench.client.send(position=0.0, effort=5.0)
    status, _, outcome = bench.client.result(sent)
    assert (status, outcome.outcome, outcome.of_hold) == (SUCCEEDED, Outcome.FORCE_REACHED, False)
    bench.wait(0.2)
    bench.motor.commands.clear()
    return sent


def test_a_hold_follows_what_gives_way_after_the_goal_has_ended(make_bench):
    bench = make_bench(parameters={'hold': True})
    sent = hold(bench)
    answer = sent.cancel()
    bench.until(answer.done)
    assert not answer.result().goals_canceling  # A cancel of the goal that has ended changes nothing.
    bench.pads.width -= SHRINKS
    bench.until(lambda: max(bench.pads.forces()) > 4.9)
    bench.wait(0.2)
    assert {each.effort for each in bench.motor.commands} == {10.0} and sent.of_hold is None
    assert bench.close(position=LIMITS.widest)[2].outcome == Outcome.REACHED
    assert sent.of_hold.outcome == Outcome.REPLACED  # The outcome of the hold has the id of its goal.


@LONG
def test_killed_in_a_correction_the_gripper_has_a_safe_command(make_bench):
    bench = make_bench(has_node=False)
    with bench.node_as_process('hold:=true') as process:
        hold(bench)
        bench.motor.slowness = 5.0
        bench.pads.width -= 0.004
        bench.until(lambda: bench.motor.moves)
        process.send_signal(signal.SIGKILL)
        process.wait()
        bench.wait(0.2)
        assert bench.motor.moves and {each.effort for each in bench.motor.commands} == {10.0}
