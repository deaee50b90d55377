"""Send the commands of the rules to the gripper's own action."""

from collections import deque
from typing import Any
from uuid import uuid4

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.node import Node
from unique_identifier_msgs.msg import UUID

from tactile_node.grasp.opening import LinearGap
from tactile_node.gripper.messages import GoalValues, GripperInterface
from tactile_node.gripper.rules.commands import Command, Commands, GripperResult

#: Maximum number of unanswered cancel requests for one command. The middleware does not queue more requests.
MOST_CANCELS = 10


class GripperClient:
    """Client of the gripper's own action (see `GripperAction`).

    Each command carries an effort limit, so the gripper stays within that limit even if this process ends.

    Parameters
    ----------
    node : Node
        Node that sends the commands.
    interface : GripperInterface
        Type of the gripper's action.
    action : str
        Name of the gripper's action.
    law : LinearGap
        Relation between the position that the gripper reports and its opening.
    effort : float
        Effort limit sent with each command, in the unit of the gripper.
    """

    def __init__(self, node: Node, interface: GripperInterface, action: str, law: LinearGap, effort: float):
        self._interface, self._law, self._effort = interface, law, effort
        self._client = ActionClient(node, interface.action, action)

    def destroy(self) -> None:
        """Destroy the action client. Commands that were already sent continue."""
        self._client.destroy()

    @property
    def is_there(self) -> bool:
        return self._client.server_is_ready()

    def send(self, opening: float, speed: float, command: Command, commands: Commands) -> 'RosGoal':
        goal_id = UUID(uuid=list(uuid4().bytes))
        goal = RosGoal(ClientGoalHandle(self._client, goal_id, None), command, commands)
        values = GoalValues(self._law.reading(opening), abs(speed / self._law.scale), self._effort)

        def on_feedback(message: Any) -> None:
            commands.on_feedback(self._law.gap(self._interface.state(message.feedback).position))

        def on_result(done: Any) -> None:
            answer = done.result()
            if answer.status == GoalStatus.STATUS_UNKNOWN:
                commands.on_lost_result(command)
                return
            state = self._interface.state(answer.result)
            is_success = answer.status == GoalStatus.STATUS_SUCCEEDED
            commands.on_result(command, GripperResult(state.reached_goal, state.stalled, is_success))

        def on_answer(done: Any) -> None:
            handle = done.result()
            if not handle.accepted:
                commands.on_rejected(command)
                return
            goal.handle = handle
            commands.on_accepted(command)
            handle.get_result_async().add_done_callback(on_result)
        self._client.send_goal_async(self._interface.goal(values), on_feedback, goal_id).add_done_callback(on_answer)
        return goal


class RosGoal:
    """A goal that was sent to the gripper's own action (see `SentGoal`)."""

    def __init__(self, handle: ClientGoalHandle, command: Command, commands: Commands):
        self.handle = handle
        self._command, self._commands = command, commands
        self._cancels: deque[Any] = deque()  # futures of the cancel requests, which are repeated until answered

    def cancel(self) -> None:
        while self._cancels:
            self._cancels.popleft().cancel()  # otherwise, rclpy never discards an unanswered request
        self._request()

    def repeat_cancel(self) -> None:
        if self._cancels:
            self._request()

    def _request(self) -> None:
        if len(self._cancels) == MOST_CANCELS:
            self._cancels.popleft().cancel()
        future = self.handle.cancel_goal_async()
        self._cancels.append(future)
        future.add_done_callback(self._on_answer)

    def _on_answer(self, future: Any) -> None:
        if future.cancelled() or future not in self._cancels:  # an earlier request for this cancel was answered
            return
        self._cancels.clear()
        answer = future.result()
        is_unknown = answer.return_code == answer.ERROR_UNKNOWN_GOAL_ID
        is_gone = is_unknown or answer.return_code == answer.ERROR_GOAL_TERMINATED
        self._commands.on_cancelled(self._command, is_ending=is_gone or bool(answer.goals_canceling),
                                    is_unknown=is_unknown)
