"""A client of `touch_gripper` for planners, which sends goals and matches each outcome to its goal by ID."""

import math
import time
from collections.abc import Callable
from typing import Any, NamedTuple
from uuid import uuid4
from weakref import WeakValueDictionary

import rclpy
from action_msgs.msg import GoalStatus
from rclpy.node import Node
from unique_identifier_msgs.msg import UUID

from tactile_node.gripper.locked_action_client import LockedActionClient
from tactile_node.gripper.messages import PARALLEL, GoalValues, GripperState, gripper_interface
from tactile_node.gripper.put_down_goal import PutDownGoal
from tactile_node.ros.time_messages import duration_message
from tactile_skin.action import PutDown
from tactile_skin.msg import GripperOutcome

OUTCOME_WAIT = 1.0  #: time after the result for which the client waits for the outcome before it counts as lost [s]
LOOK_PERIOD = 0.005  #: time between two checks for the end of a goal [s]


class TouchEnding(NamedTuple):
    """How a goal has ended."""

    #: GoalStatus of the goal; STATUS_UNKNOWN if the goal was rejected, or if its result was requested too late
    status: int
    state: GripperState
    outcome: GripperOutcome | None  #: outcome of the goal, or None if the outcome was lost


class TouchGoal:
    """A goal that was sent. ``handle`` is rclpy's goal handle, or None until the goal is accepted."""

    def __init__(self, steady: Callable[[], float]):
        self._steady = steady
        self._result: tuple[int, GripperState] | None = None
        self._result_at = math.inf  # time when the result arrived [s]
        self.handle: Any = None
        self.outcome: GripperOutcome | None = None
        self.of_hold: GripperOutcome | None = None  #: outcome of the hold after this goal, or None until the hold ends

    @property
    def ending(self) -> TouchEnding | None:
        """How the goal ended, or None while it is in progress. The result and the outcome may arrive in any order."""
        is_known = self.outcome is not None or self._steady() - self._result_at > OUTCOME_WAIT
        return TouchEnding(*self._result, self.outcome) if self._result is not None and is_known else None

    def cancel(self) -> Any:
        """Cancel the goal and return rclpy's future. The goal must have been accepted."""
        return self.handle.cancel_goal_async()

    def _accept(self, handle: Any, state: Callable[[Any], GripperState]) -> None:
        if not handle.accepted:
            self._end(GoalStatus.STATUS_UNKNOWN, GripperState())
            return
        self.handle = handle
        handle.get_result_async().add_done_callback(
            lambda done: self._end(done.result().status, state(done.result().result)))

    def _end(self, status: int, state: GripperState) -> None:
        self._result, self._result_at = (status, state), self._steady()


class TouchClient:
    """Sends goals to the action of a gripper node and finds the outcome of each goal; see docs/closing.md.

    Parameters
    ----------
    node
        Node that the caller owns.
    action
        Name of the gripper node's action.
    action_type
        Type of the action: ParallelGripperCommand or GripperCommand.
    joint
        Name of the joint in a ParallelGripperCommand; '' to name no joint.
    steady
        Steady clock [s].

    Raises
    ------
    ConfigurationError
        Raised if the action type is unknown, or if control_msgs is not installed.
    """

    def __init__(self, node: Node, action: str = 'touch_gripper/gripper_cmd', *, action_type: str = PARALLEL,
                 joint: str = '', steady: Callable[[], float] = time.monotonic):
        self._node, self._steady = node, steady
        self._action = action
        self._interface = gripper_interface(action_type, joint)
        # goals to which the caller still has a reference
        self._goals: WeakValueDictionary[bytes, TouchGoal] = WeakValueDictionary()
        name = action.rpartition('/')[0]
        self._client = LockedActionClient(node, self._interface.action, action)
        self._put_down = LockedActionClient(node, PutDown, f'{name}/put_down')
        self._outcomes = node.create_subscription(GripperOutcome, f'{name}/outcome', self._on_outcome, 10)

    @property
    def is_ready(self) -> bool:
        """True if the gripper node's action server and outcome topic were discovered."""
        return self._client.server_is_ready() and self._node.count_publishers(self._outcomes.topic_name) > 0

    @property
    def is_ready_to_put_down(self) -> bool:
        """True if the gripper node's action to put down was discovered."""
        return self._put_down.server_is_ready()

    def send(self, position: float, speed: float = 0.0, effort: float = 0.0, *, goal: Any = None) -> TouchGoal:
        """Send a goal. Keep a reference to the returned object. Otherwise, the client drops the outcome of the goal.

        Parameters
        ----------
        position, speed, effort
            Values of the goal in the gripper's own units.
        goal
            Complete goal message of the action, which replaces the three values.
        """
        sent, goal_id = TouchGoal(self._steady), uuid4().bytes
        self._goals[goal_id] = sent
        message = self._interface.goal(GoalValues(position, speed, effort)) if goal is None else goal
        future = self._client.send_goal_async(message, goal_uuid=UUID(uuid=list(goal_id)))
        future.add_done_callback(lambda done: sent._accept(done.result(), self._interface.state))
        return sent

    def put_down(self, timeout: float) -> PutDownGoal:
        """Watch the held object until something touches it, and return the goal; see docs/put_down.md.

        Lower the arm only while `PutDownGoal.is_watching` is True. The method sends no command to the gripper.

        Parameters
        ----------
        timeout
            Time after which the goal ends without a touch [s].
        """
        sent = PutDownGoal(self._steady)
        goal = PutDown.Goal(timeout=duration_message(timeout))
        self._put_down.send_goal_async(goal, sent.on_feedback).add_done_callback(sent.on_answer)
        return sent

    def wait(self, goal: TouchGoal, timeout: float, *, spin: bool = False) -> TouchEnding:
        """Wait until a goal ends, and return how it ended.

        Do not call this method from a callback of the node; in a callback, read `TouchGoal.ending`. A goal whose server
        has died never ends.

        Parameters
        ----------
        goal
            Goal to wait for.
        timeout
            Maximum waiting time [s].
        spin
            True if this method has to spin the client's node, because no executor does. If two executors wait for the
            same node, rclpy fails.

        Raises
        ------
        TimeoutError
            Raised if the goal has not ended after ``timeout``.
        """
        end = self._steady() + timeout
        while (ending := goal.ending) is None:
            if self._steady() > end:
                unspun = self._node.executor is None and not spin
                raise TimeoutError(f'{self._action}: the goal has not ended within {timeout:g} s'
                                   + (', and no executor spins the node: pass spin=True' if unspun else ''))
            if spin:
                rclpy.spin_once(self._node, timeout_sec=LOOK_PERIOD)
            else:
                time.sleep(LOOK_PERIOD)
        return ending

    def destroy(self) -> None:
        self._client.destroy()
        self._put_down.destroy()
        self._node.destroy_subscription(self._outcomes)

    def _on_outcome(self, outcome: GripperOutcome) -> None:
        goal = self._goals.get(bytes(outcome.goal_id))
        if goal is not None and outcome.of_hold:
            goal.of_hold = outcome
        elif goal is not None:
            goal.outcome = outcome
