"""Action server of the simulated gripper for control_msgs/action/ParallelGripperCommand, as on a real gripper."""

import threading
import time

from control_msgs.action import ParallelGripperCommand
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from examples.simulated_gripper.drive import DELAY, SETTLED, Command
from examples.simulated_gripper.session import JOINT, joint_state
from examples.simulated_gripper.world import World
from tactile_node.errors import InputError

ACTION = 'hand/gripper_cmd'
LOOK_PERIOD = 0.02  #: period of checking the gripper's state and publishing it as feedback [s]


def command_of(goal: ParallelGripperCommand.Goal) -> Command:
    """Return the command for a goal. Raises InputError.

    The position is the gap [m]. If the speed [m/s] or the effort [N] is missing or 0, the server uses the default.
    """
    asked = goal.command
    if len(asked.position) != 1 or list(asked.name) not in ([], [JOINT]):
        raise InputError('gripper command', expected=f'the position of {JOINT}', got=f'{list(asked.name)}, '
                         f'{list(asked.position)}', remedy='Send exactly one position, the gap in metres.')
    limits = {name: values[0] for name, values in (('velocity', asked.velocity), ('effort', asked.effort))
              if len(values) and values[0]}
    return Command(asked.position[0], **limits)


class GripperServer:
    """Action server in which a new goal aborts the previous goal, and a cancelled goal stops the gripper in place.

    The callbacks block, so the node needs an executor with several threads.
    """

    def __init__(self, node: Node, world: World):
        self._node, self._world = node, world
        self._latest: ServerGoalHandle | None = None
        self._lock = threading.Lock()  # this lock protects the latest goal and its command
        self._server = ActionServer(
            node, ParallelGripperCommand, ACTION, self._execute, goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted, cancel_callback=lambda handle: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup())

    def _on_goal(self, goal: ParallelGripperCommand.Goal) -> GoalResponse:
        try:
            command_of(goal)
        except InputError as error:
            self._node.get_logger().error(str(error))
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        with self._lock:
            self._latest = handle
            self._world.command(command_of(handle.request))
        handle.execute()

    def _execute(self, handle: ServerGoalHandle) -> ParallelGripperCommand.Result:
        while self._latest is handle and not handle.is_cancel_requested:
            is_stalled, is_at_goal = self._world.drive.is_stalled, self._world.drive.is_at_goal
            if is_stalled or is_at_goal:
                handle.succeed()
                return self._result(is_stalled, is_at_goal)
            handle.publish_feedback(ParallelGripperCommand.Feedback(state=joint_state(self._node, self._world)))
            time.sleep(LOOK_PERIOD)
        return self._ended(handle)

    def _ended(self, handle: ServerGoalHandle) -> ParallelGripperCommand.Result:
        with self._lock:
            is_latest = self._latest is handle
            if is_latest:
                self._world.stop_gripper()
        if is_latest:
            time.sleep(DELAY + 2 * SETTLED)  # wait until the gripper has stopped
        if handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return self._result(False, False)

    def _result(self, stalled: bool, reached_goal: bool) -> ParallelGripperCommand.Result:
        return ParallelGripperCommand.Result(state=joint_state(self._node, self._world), stalled=stalled,
                                             reached_goal=reached_goal)
