"""Carry out the goals of the action `~/put_down`, which watches a held object while an arm lowers it."""

import logging
from collections.abc import Callable

from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from tactile_node.errors import RefusedRequirementError
from tactile_node.gripper.duplicate_watch import DuplicateWatch
from tactile_node.gripper.gripper_settings import GripperSettings
from tactile_node.gripper.messages import held_reading
from tactile_node.gripper.rules.control import TouchControl
from tactile_node.gripper.rules.put_down import LONGEST_TIMEOUT, NOTHING_READ, PutDown, PutDownOutcome, Sign
from tactile_node.nodes.grasp_requests import allow_feedback
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.ros.grasp_checks import check_grasp_sides
from tactile_node.ros.message_age import InputAge
from tactile_node.ros.requirement_messages import timeout_of
from tactile_node.ros.rosout_handler import of_node
from tactile_skin import action
from tactile_skin.msg import GraspSides

LOOK_PERIOD = 0.01  #: Time between two looks at the pads [s].
RESULT_TIMEOUT = 2  #: Time for which the server keeps a result that the client has not yet requested [s].

logger = logging.getLogger(__name__)


class PutDownWatch:
    """Serves the action `~/put_down`, one goal at a time. It sends no command to the gripper.

    While a goal is in progress, the watch listens to the results of both pads, and the hold corrects nothing. Without a
    goal, the grasp node need not publish these results.

    Parameters
    ----------
    node : Node
        Node that offers the action.
    control : TouchControl
        Rules that carry out the goals of the gripper.
    duplicates : DuplicateWatch
        Other processes that command the same gripper.
    settings : GripperSettings
        Parameters of the node.
    steady : callable
        Steady clock for ages and timeouts [s].
    """

    def __init__(self, node: Node, control: TouchControl, duplicates: DuplicateWatch, settings: GripperSettings, *,
                 steady: Callable[[], float]):
        self._node, self._control, self._duplicates = node, control, duplicates
        self._settings, self._steady = settings, steady
        self._goal: _RunningPutDown | None = None
        # The timer uses the steady clock, because with use_sim_time and no /clock, a goal would never time out.
        self._timer = node.create_timer(LOOK_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._timer.cancel()
        self._server = ActionServer(
            node, action.PutDown, '~/put_down', execute_callback=lambda handle: action.PutDown.Result(),
            handle_accepted_callback=self._accept, cancel_callback=lambda handle: CancelResponse.ACCEPT,
            result_timeout=RESULT_TIMEOUT)

    def destroy(self) -> None:
        """End the watch without a reply. A client notices that the feedback ceases."""
        self._timer.cancel()
        if self._goal is not None:
            self._goal.sides.destroy()
        self._server.destroy()

    def _accept(self, handle: ServerGoalHandle) -> None:
        """Carry out a goal, or refuse it."""
        allow_feedback(handle)
        try:
            timeout = timeout_of(handle.request.timeout, LONGEST_TIMEOUT)
        except RefusedRequirementError as error:
            self._reply(handle, PutDownOutcome.REFUSED, str(error))
            return
        if self._goal is not None:
            self._end(self._goal, PutDownOutcome.REPLACED)
        rules = PutDown(self._steady(), timeout, self._settings.max_age)
        self._goal = _RunningPutDown(self._node, handle, rules, self._settings, self._steady)
        self._control.suspends_hold = True
        self._timer.reset()

    def _look(self) -> None:
        goal = self._goal
        if goal is None:
            return
        used = goal.rules.used
        outcome = self._outcome(goal)
        if outcome is not None:
            self._end(goal, outcome)
        elif goal.rules.used > used:  # without a new usable frame, no feedback is due
            goal.handle.publish_feedback(action.PutDown.Feedback(watching=goal.rules.is_watching))

    def _outcome(self, goal: '_RunningPutDown') -> PutDownOutcome | None:
        if goal.handle.is_cancel_requested:
            return PutDownOutcome.CANCELED
        if self._duplicates.text:
            goal.rules.reason = self._duplicates.text
            return PutDownOutcome.DUPLICATE
        return goal.rules.look(self._steady(), goal.reading, is_resting=self._control.is_resting)

    def _end(self, goal: '_RunningPutDown', outcome: PutDownOutcome) -> None:
        goal.sides.destroy()
        self._goal, self._control.suspends_hold = None, False
        self._timer.cancel()
        rules = goal.rules
        self._reply(goal.handle, outcome, rules.reason, rules.signs, rules.deviations)

    def _reply(self, handle: ServerGoalHandle, outcome: PutDownOutcome, reason: str, signs: Sign = Sign.NONE,
               deviations: float = 0.0) -> None:
        text = f'{outcome.name}: {reason}' if reason else outcome.name
        logger.info('put-down ended: %s', text, extra=of_node(self._node))
        result = action.PutDown.Result(message=text, outcome=int(outcome), signs=int(signs), deviations=deviations)

        def execute(handle: ServerGoalHandle) -> action.PutDown.Result:
            end = handle.succeed if outcome is PutDownOutcome.SOMETHING_TOUCHES else handle.abort
            (handle.canceled if outcome is PutDownOutcome.CANCELED else end)()
            return result
        handle.execute(execute)


class _RunningPutDown:
    """A goal in progress, with the latest reading of the pads."""

    def __init__(self, node: Node, handle: ServerGoalHandle, rules: PutDown, settings: GripperSettings,
                 steady: Callable[[], float]):
        self.handle, self.rules = handle, rules
        self.reading = NOTHING_READ
        self._node, self._ages = node, InputAge(steady=steady)
        self.sides = GuardedSubscription(node, GraspSides, 'grasp_sides', self._on_sides, settings.input_qos,
                                         check=check_grasp_sides, newest_only=True, lossless=settings.lossless,
                                         steady=steady)

    def _on_sides(self, sides: GraspSides) -> None:
        arrival = self._ages.arrived(sides)
        is_only_one = self._node.count_publishers(self.sides.topic) <= 1  # either of two publishers may be wrong
        self.reading = held_reading(sides, arrival.acquired) if is_only_one else NOTHING_READ
