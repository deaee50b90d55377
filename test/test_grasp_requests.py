"""Tests that no old grasp fulfils a goal of the grasp node's action or a request to its service."""

import time
from functools import partial
from math import nan

import pytest
import rclpy
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from rclpy.action import ActionClient
from rclpy.action.server import GoalEvent, ServerGoalHandle
from rclpy.parameter import Parameter
from ros_bench import TIMEOUT
from test_grasp_node import BOTH, PERIOD, SIM_TIME, Gripper, hidden_shape

from tactile_node.errors import RefusedRequirementError, RequirementRefusal
from tactile_node.grasp.tracker import GraspContact, GraspState, SideState
from tactile_node.nodes.grasp_requests import MOST_GOALS, CurrentGrasp, GraspRequests
from tactile_node.nodes.spinner import SpinnerExecutor
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.message_age import age_seconds
from tactile_node.ros.requirement_messages import requirement_of, timeout_of
from tactile_node.ros.time_messages import duration_message
from tactile_skin.action import WaitForGrasp
from tactile_skin.msg import ContactShape, Grasp, GraspRequirement, GraspSides, RequirementState
from tactile_skin.srv import CheckGrasp

pytestmark = [pytest.mark.ros, pytest.mark.bus]

Result, S = WaitForGrasp.Result, RequirementState
LONG = 60.0  # Timeout that is too long to expire in a test [s].


class Planner:
    """A client of a grasp node, which receives shapes from two classifiers."""

    def __init__(self, stack, parameters=(), lossless=False, **bench):
        self.gripper = Gripper(stack, parameters, lossless=lossless, **bench)
        node = self.gripper.add('planner')
        self._actions = ActionClient(node, WaitForGrasp, '/grasp/wait_for_grasp')
        stack.callback(self._actions.destroy)
        self._checks = node.create_client(CheckGrasp, '/grasp/check_grasp')
        self.gripper.until_joined(lambda: self._actions.server_is_ready() and self._checks.service_is_ready())

    def until(self, condition, sides=()) -> None:
        end = self.gripper.steady() + TIMEOUT
        while not condition():
            assert self.gripper.steady() < end
            self.gripper.run(PERIOD, sides)

    def send(self, timeout=LONG, sides=(), **required):
        """Send a goal, and return its handle and the list that collects its feedback."""
        feedback = []
        goal = WaitForGrasp.Goal(requirement=GraspRequirement(**required), timeout=timeout if isinstance(
            timeout, Duration) else duration_message(timeout))
        sent = self._actions.send_goal_async(goal, lambda message: feedback.append(message.feedback))
        self.until(sent.done, sides)
        return sent.result(), feedback

    def result(self, handle, sides=()):
        asked = handle.get_result_async()
        self.until(asked.done, sides)
        return asked.result().status, asked.result().result

    def check(self, sides=(), **required):
        call = self._checks.call_async(CheckGrasp.Request(requirement=GraspRequirement(**required)))
        self.until(call.done, sides)
        return call.result()


@pytest.fixture
def make_planner(ros):
    return partial(Planner, ros)


@pytest.fixture
def planner(make_planner):
    return make_planner()


def test_an_answer_names_the_publishers_of_grasp_if_there_are_several(planner):
    assert planner.check().message.count('/grasp') == 0
    planner.gripper.add('rival').create_publisher(Grasp, '/grasp', 1)
    planner.until(lambda: '/grasp has several publishers: /grasp, /rival' in planner.check().message)
    handle, _ = planner.send(timeout=0.1)
    assert '/grasp has several publishers: /grasp, /rival' in planner.result(handle)[1].message


@pytest.fixture
def make_own(ros):
    """Return a function that makes a real-time planner, served by the executor that our processes use.

    The large ``max_age`` prevents shapes from becoming too old on a busy machine.
    """
    return partial(Planner, ros, (('max_age', Parameter.Type.DOUBLE, 10.0),), executor=SpinnerExecutor(),
                   is_real_time=True)


@pytest.fixture(params=['', 'rules of Lyrical'])
def rules(request, monkeypatch):
    """Apply the rules of rclpy 10.0.10 to goals that are accepted but not yet executing.

    For a goal that is not yet executing, rclpy sends no feedback, and ``executing`` may be called first.
    """
    update, publish = ServerGoalHandle._update_state, ServerGoalHandle.publish_feedback

    def is_executing(handle):
        return handle.status == GoalStatus.STATUS_EXECUTING

    def update_once(handle, event=GoalEvent.EXECUTE):
        if event != GoalEvent.EXECUTE or not is_executing(handle):
            update(handle, event)
    if request.param:
        monkeypatch.setattr(ServerGoalHandle, 'executing', update_once, raising=False)
        monkeypatch.setattr(ServerGoalHandle, '_update_state', update_once)
        monkeypatch.setattr(ServerGoalHandle, 'publish_feedback',
                            lambda handle, message: publish(handle, message) if is_executing(handle) else None)


def test_goals_wait_beside_each_other_and_each_gets_its_answer(rules, planner):
    held, feedback = planner.send()
    other, _ = planner.send(shapes=[ContactShape.CIRCLE])
    short, _ = planner.send(timeout=0.2)
    status, result = planner.result(short)
    assert (status, result.outcome, result.state.missing) == (GoalStatus.STATUS_ABORTED, Result.TIMED_OUT, S.NO_RESULT)
    assert result.grasp == Grasp()
    status, result = planner.result(held, BOTH)
    assert (status, result.outcome, result.state.missing) == (GoalStatus.STATUS_SUCCEEDED, Result.HELD, S.NOTHING)
    assert check_grasp(result.grasp) is None and result.grasp.stable and result.grasp.fresh
    assert age_seconds(result.grasp.age) < 0.3
    assert {each.state.missing for each in feedback} >= {S.NO_RESULT, S.UNSEEN, S.NOT_STABLE}
    call = other.cancel_goal_async()
    planner.until(call.done, BOTH)
    status, result = planner.result(other, BOTH)
    assert (status, result.outcome, result.state.missing) == (GoalStatus.STATUS_CANCELED, Result.CANCELED,
                                                              S.OTHER_SHAPE)
    # No shapes arrive during the check, but the last shapes are still current.
    assert planner.check().outcome == CheckGrasp.Response.HELD


def test_each_of_the_goals_that_end_together_gets_its_answer(make_own):
    """The middleware queues only a limited number of service requests and replies, and silently drops the rest."""
    planner = make_own()
    handles = [planner.send(shapes=[ContactShape.SQUARE])[0] for _ in range(MOST_GOALS)]
    asked = [handle.get_result_async() for handle in handles]
    planner.gripper.wait(0.2)
    for handle in handles:
        handle.cancel_goal_async()
    planner.until(lambda: all(each.done() for each in asked))
    assert [each.result().result.outcome for each in asked] == [Result.CANCELED] * MOST_GOALS


def test_the_last_grasp_of_a_lossless_replay_that_has_ended_is_not_held(make_planner):
    """The clock follows the stamps, which stop at the end of the replay."""
    planner = make_planner((('lossless', Parameter.Type.BOOL, True),), lossless=True)
    planner.until(lambda: planner.gripper.grasps and planner.gripper.latest.stable, BOTH)
    planner.gripper.wait(0.4)
    answer = planner.check()
    assert (answer.outcome, answer.state.missing) == (CheckGrasp.Response.NOT_HELD, S.UNSEEN)
    handle, _ = planner.send(timeout=0.2)
    assert planner.result(handle)[1].outcome == Result.TIMED_OUT


def test_a_goal_times_out_when_pads_go_silent_and_never_succeeds_with_an_old_grasp(make_planner):
    planner = make_planner(SIM_TIME)  # with simulated time and no clock, only the steady clock advances
    planner.until(lambda: planner.gripper.grasps and planner.gripper.latest.stable, BOTH)
    planner.until(lambda: not planner.gripper.latest.fresh)
    assert planner.check().state.missing == S.UNSEEN
    handle, feedback = planner.send(timeout=0.6)
    status, result = planner.result(handle)
    assert (status, result.outcome, result.state.missing) == (GoalStatus.STATUS_ABORTED, Result.TIMED_OUT, S.UNSEEN)
    assert result.grasp == Grasp() and {each.state.missing for each in feedback} == {S.UNSEEN}


def test_a_pad_that_is_hidden_while_a_goal_waits_is_the_reason(planner):
    planner.until(lambda: planner.gripper.grasps and planner.gripper.latest.stable, BOTH)
    handle, _ = planner.send(timeout=1.0, sides=BOTH, shapes=[ContactShape.CIRCLE])
    asked = handle.get_result_async()
    while not asked.done():
        planner.gripper.run(PERIOD, shapes={'right': hidden_shape()})
    assert (asked.result().result.outcome, asked.result().result.state.missing) == (Result.TIMED_OUT, S.UNSEEN)


def test_the_service_answers_at_once_from_what_is_current(planner):
    assert planner.check().state.missing == S.NO_RESULT
    planner.until(lambda: planner.gripper.grasps and planner.gripper.latest.stable, BOTH)
    answers = []
    # An answer may arrive during a pause of the shapes, so the check is repeated.
    while not answers or answers[-1].outcome != CheckGrasp.Response.HELD:
        planner.gripper.run(PERIOD, BOTH)
        answers.append(planner.check())
        assert len(answers) < 100
    assert answers[-1].grasp.stable and answers[-1].state.missing == S.NOTHING
    assert answers[-1].refusal == CheckGrasp.Response.NOT_REFUSED
    refused = planner.check(max_width=nan)
    assert (refused.outcome, refused.refusal) == (CheckGrasp.Response.REFUSED, CheckGrasp.Response.NOT_A_LIMIT)
    assert refused.message and refused.state.missing == S.NOT_KNOWN
    refused = planner.check(class_names=['sqare'])
    assert refused.refusal == CheckGrasp.Response.NO_SUCH_SHAPE and 'unknown' not in refused.message


def test_a_goal_with_wrong_limits_is_refused_with_the_reason_and_so_is_one_too_many(planner):
    R = CheckGrasp.Response

    def refusal(**goal):
        handle, _ = planner.send(**goal)
        status, result = planner.result(handle)
        assert (status, result.outcome, result.state) == (GoalStatus.STATUS_ABORTED, Result.REFUSED, RequirementState())
        assert result.message.startswith('REFUSED: ') and result.grasp == Grasp()
        return result.refusal
    assert refusal(min_width=nan) == refusal(min_held=Duration(sec=-1)) == R.NOT_A_LIMIT
    assert refusal(timeout=Duration(sec=-1)) == R.NOT_A_LIMIT
    assert refusal(shapes=[ContactShape.NONE]) == R.NO_SUCH_SHAPE
    assert refusal(timeout=0.0) == refusal(timeout=3601.0) == R.NO_TIMEOUT
    handles = [planner.send()[0] for _ in range(MOST_GOALS)]
    assert refusal() == R.TOO_MANY_GOALS
    cancelled = handles[0].cancel_goal_async()
    planner.until(cancelled.done)
    assert planner.result(handles[0])[1].outcome == Result.CANCELED
    last, _ = planner.send(timeout=0.2)
    assert planner.result(last)[1].outcome == Result.TIMED_OUT


def test_a_goal_that_waits_does_not_keep_the_executor_busy(make_own):
    """A goal must not wait in a coroutine, because the executor would poll the coroutine without a pause."""
    planner = make_own()
    planner.send()
    passes, before = 0, time.process_time()
    end = time.monotonic() + 0.5
    while time.monotonic() < end:
        planner.gripper.executor.spin_once(timeout_sec=0.05)
        passes += 1
    assert passes < 100, time.process_time() - before


@pytest.mark.parametrize(('message', 'refusal'), [
    (GraspRequirement(shapes=[ContactShape.UNKNOWN]), RequirementRefusal.NO_SUCH_SHAPE),
    (GraspRequirement(shapes=[ContactShape.OTHER]), RequirementRefusal.NO_SUCH_SHAPE),
    (GraspRequirement(shapes=[99]), RequirementRefusal.NO_SUCH_SHAPE),
    (GraspRequirement(class_names=['none']), RequirementRefusal.NO_SUCH_SHAPE),
    (GraspRequirement(shapes=[3] * 1000), RequirementRefusal.TOO_MANY_SHAPES),
    (GraspRequirement(min_held=Duration(sec=-1)), RequirementRefusal.NOT_A_LIMIT),
    (GraspRequirement(min_held=Duration(nanosec=10**9)), RequirementRefusal.NOT_A_LIMIT),
    (GraspRequirement(max_misalignment=nan), RequirementRefusal.NOT_A_LIMIT)])
def test_a_requirement_that_cannot_be_used_is_refused(message, refusal):
    with pytest.raises(RefusedRequirementError) as error:
        requirement_of(message)
    assert error.value.refusal is refusal


def test_a_requirement_arrives_by_codes_names_and_units():
    found = requirement_of(GraspRequirement(
        shapes=[ContactShape.SQUARE], class_names=['gear'], min_confidence=0.5, min_held=Duration(nanosec=250_000_000),
        min_width=0.01, max_width=0.02, max_offset=0.003, max_misalignment=0.1, accept_bound=True), ('square', 'gear'))
    assert (found.shapes, found.min_confidence, found.min_held) == ({'square', 'gear'}, 0.5, 0.25)
    assert (found.min_width, found.max_width, found.max_offset, found.max_misalignment) == (0.01, 0.02, 0.003, 0.1)
    assert found.accepts_bound and timeout_of(Duration(sec=2)) == 2.0


def test_a_grasp_that_is_lost_before_the_answer_leaves_is_not_reported_as_held(planner):
    """Between the decision on a goal and the answer, the executor may run other callbacks."""
    held = GraspState((SideState.TOUCHED,) * 2, GraspContact.TWO_SIDED, fresh=True, same_shape=True, line=None,
                      line_is_bound=False, held=1.0, stable=True, creep=0.0)
    unseen = held._replace(contact=GraspContact.UNSEEN, fresh=False, stable=False)
    # The first two readings still show a held grasp. All later readings show that the grasp is lost.
    looks = [held, held]
    sides = [ContactShape(), ContactShape()]
    node = rclpy.create_node('brief')
    requests = GraspRequests(node, lambda: CurrentGrasp(looks.pop() if looks else unseen, sides, Grasp, GraspSides))
    planner.gripper.executor.add_node(node)
    client = ActionClient(node, WaitForGrasp, '/brief/wait_for_grasp')
    planner.gripper.until_joined(client.server_is_ready)
    sent = client.send_goal_async(WaitForGrasp.Goal(timeout=Duration(sec=60)))
    planner.until(sent.done)
    status, result = planner.result(sent.result())
    assert (status, result.outcome, result.state.missing) == (GoalStatus.STATUS_ABORTED, Result.LOST, S.UNSEEN)
    client.destroy()
    requests.destroy()
    node.destroy_node()
