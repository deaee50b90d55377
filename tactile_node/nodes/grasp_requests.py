"""The action `~/wait_for_grasp` and the service `~/check_grasp` of the grasp node."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from tactile_node.code_names import name_of
from tactile_node.errors import RefusedRequirementError, RequirementRefusal
from tactile_node.grasp.requirement import NO_SHAPES, Missing, Requirement, SideShape, missing
from tactile_node.grasp.tracker import GraspState
from tactile_node.ros.message_health import several_text
from tactile_node.ros.publishers import publisher_names
from tactile_node.ros.requirement_messages import requirement_of, state_message, timeout_of
from tactile_node.ros.shape_messages import PadShape
from tactile_skin.action import WaitForGrasp
from tactile_skin.msg import Grasp, GraspSides
from tactile_skin.srv import CheckGrasp

#: Time between two checks of the waiting goals [s]. The goals are also checked at each published grasp.
GOAL_LOOK_PERIOD = 0.05
FEEDBACK_PERIOD = 0.5  #: Time after which unchanged feedback is published again [s].
#: Maximum number of waiting goals. One grasp may complete all waiting goals, and an rmw service queues only 10 replies.
MOST_GOALS = 10
#: Time for which the server keeps a result that the client has not yet requested [s]. An older result is out of date.
RESULT_TIMEOUT = 2


class CurrentGrasp(NamedTuple):
    """The grasp at one moment, with functions to evaluate and publish it."""

    state: GraspState
    sides: Sequence[PadShape]  #: latest shapes of the left and the right pad
    message: Callable[[], Grasp]  #: creates the message for this grasp
    sides_message: Callable[[], GraspSides]  #: creates the message with both sides, with the same age

    def missing(self, requirement: Requirement) -> tuple[Missing, ...]:
        """Return the conditions of ``requirement`` that the grasp does not meet."""
        left, right = (SideShape(side.class_name, side.confidence) for side in self.sides)
        return missing(requirement, self.state, (left, right))


@dataclass
class _WaitingGoal:
    handle: ServerGoalHandle
    requirement: Requirement
    deadline: float  #: time on the steady clock at which the goal times out [s]
    reported: tuple[Missing, ...] | None = None  #: unmet conditions in the last feedback
    reported_at: float = 0.0  #: time of the last feedback [s]


class GraspRequests:
    """Serves the action `~/wait_for_grasp` and the service `~/check_grasp`.

    Each reply describes the grasp at the time of the reply, never an earlier grasp.

    A waiting goal is not executed, because rclpy would poll the goal's coroutine continuously. A waiting goal
    therefore has the status ACCEPTED (in Lyrical EXECUTING, see `allow_feedback`). Once the outcome of the goal is
    known, the goal is executed, and its callback evaluates the grasp again.

    Parameters
    ----------
    node : Node
        Node that offers the action and the service.
    current : callable
        Function that returns the current grasp.
    steady : callable
        Steady clock for timeouts [s].
    """

    def __init__(self, node: Node, current: Callable[[], CurrentGrasp],
                 steady: Callable[[], float] = time.monotonic):
        self._node = node
        self._steady = steady
        self._current = current
        self._goals: list[_WaitingGoal] = []
        self._server = ActionServer(
            node, WaitForGrasp, '~/wait_for_grasp', execute_callback=lambda handle: WaitForGrasp.Result(),
            handle_accepted_callback=self._on_accepted,
            cancel_callback=lambda handle: CancelResponse.ACCEPT, result_timeout=RESULT_TIMEOUT)
        self._service = node.create_service(CheckGrasp, '~/check_grasp', self._on_check)
        # The timer uses the steady clock, because with use_sim_time and no /clock, a goal would never time out.
        self._timer = node.create_timer(GOAL_LOOK_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._timer.cancel()
        self._changed = node.create_guard_condition(self._look)

    def wake(self) -> None:
        """Let the executor check the waiting goals, because the grasp has changed. Any thread may call this method."""
        if self._goals:
            self._changed.trigger()

    def _look(self) -> None:
        """Check the waiting goals against the present grasp."""
        current, now = self._current(), self._steady()
        for goal in tuple(self._goals):
            found = current.missing(goal.requirement)
            if not found or now >= goal.deadline or goal.handle.is_cancel_requested:
                self._goals.remove(goal)
                goal.handle.execute(lambda handle, goal=goal: self._finish(goal))
            elif found != goal.reported or now - goal.reported_at >= FEEDBACK_PERIOD:
                goal.reported, goal.reported_at = found, now
                goal.handle.publish_feedback(WaitForGrasp.Feedback(
                    message=', '.join(each.name for each in found), state=state_message(found)))
        if not self._goals:
            self._timer.cancel()

    def destroy(self) -> None:
        """Stop the server without replying to waiting goals. A client therefore needs its own timeout."""
        self._goals.clear()
        self._timer.cancel()
        self._server.destroy()

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        try:
            requirement, timeout = self._requirement(handle.request.requirement), timeout_of(handle.request.timeout)
            self._check_room()
        except RefusedRequirementError as error:
            # The goal is accepted first, because a rejected goal has no result that could tell the client the reason.
            handle.execute(lambda handle, error=error: self._refuse(handle, error))
            return
        allow_feedback(handle)
        self._goals.append(_WaitingGoal(handle, requirement, self._steady() + timeout))
        self._timer.reset()
        self._look()

    def _refuse(self, handle: ServerGoalHandle, error: RefusedRequirementError) -> WaitForGrasp.Result:
        result = WaitForGrasp.Result()
        self._fill(result, WaitForGrasp.Result.REFUSED, refused=error)
        handle.abort()
        return result

    def _finish(self, goal: _WaitingGoal) -> WaitForGrasp.Result:
        """Reply with the current grasp, because the grasp may have changed since ``look`` if the executor was busy."""
        current, handle, result = self._current(), goal.handle, WaitForGrasp.Result()
        found = current.missing(goal.requirement)
        if handle.is_cancel_requested:
            outcome = result.CANCELED
            handle.canceled()
        elif not found:
            outcome, result.grasp = result.HELD, current.message()
            handle.succeed()
        else:
            outcome = result.LOST if self._steady() < goal.deadline else result.TIMED_OUT
            handle.abort()
        self._fill(result, outcome, found)
        return result

    def _on_check(self, request: CheckGrasp.Request, response: CheckGrasp.Response) -> CheckGrasp.Response:
        try:
            requirement = self._requirement(request.requirement)
        except RefusedRequirementError as error:
            self._fill(response, response.REFUSED, refused=error)
            return response
        current = self._current()
        found = current.missing(requirement)
        self._fill(response, response.NOT_HELD if found else response.HELD, found)
        if not found:
            response.grasp = current.message()
        return response

    def _requirement(self, message: object) -> Requirement:
        names = dict.fromkeys(name for side in self._current().sides for name in side.probabilities
                              if name not in NO_SHAPES)
        return requirement_of(message, tuple(names))

    def _check_room(self) -> None:
        if len(self._goals) >= MOST_GOALS:
            raise RefusedRequirementError('wait_for_grasp', RequirementRefusal.TOO_MANY_GOALS,
                                          expected=f'at most {MOST_GOALS} waiting goals', got='one more',
                                          remedy='Cancel goals that are no longer needed.')

    def _fill(self, answer: WaitForGrasp.Result | CheckGrasp.Response, outcome: int, found: Sequence[Missing] = (),
              refused: RefusedRequirementError | None = None) -> None:
        """Set the outcome of ``answer``, and either the unmet conditions or the reason of a refusal.

        If the topic `grasp` has several publishers, ``answer.message`` also names the publishers. A client that
        compares the answer with the topic may otherwise not know that the topic carries the grasps of another node.
        """
        answer.outcome, answer.refusal = outcome, int(refused.refusal if refused else RequirementRefusal.NOT_REFUSED)
        if not refused:
            answer.state = state_message(found)
        reason = str(refused or ', '.join(each.name for each in found))
        topic = self._node.resolve_topic_name('grasp')
        publishers = publisher_names(self._node, topic)
        several = several_text(topic, publishers) if len(publishers) > 1 else ''
        answer.message = '; '.join(filter(None, (
            name_of(type(answer), 'outcome', outcome) + (f': {reason}' if reason else ''), several)))


def allow_feedback(handle: ServerGoalHandle) -> None:
    """Make rclpy send feedback for a goal. Since Lyrical, rclpy sends feedback only while a goal is executing."""
    if hasattr(handle, 'executing'):
        handle.executing()
