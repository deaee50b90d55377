"""Connect a commissioning to a gripper's action, to its joint states and to the taxels of two pads."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple
from uuid import uuid4

import numpy as np
from action_msgs.msg import GoalStatus, GoalStatusArray
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action.client import ClientGoalHandle
from rclpy.node import Node
from rclpy.qos import qos_profile_action_status_default, qos_profile_sensor_data
from unique_identifier_msgs.msg import UUID

from tactile_node.commissioning.mistake import Mistake, RefusedStepError
from tactile_node.commissioning.recording import JointStates, PadFrames, PadGrid, Recording
from tactile_node.errors import ConfigurationError
from tactile_node.gripper.duplicate_watch import LISTEN_TIME, DuplicateWatch
from tactile_node.gripper.locked_action_client import LockedActionClient
from tactile_node.gripper.messages import PARALLEL, GoalValues, gripper_interface
from tactile_node.node_graph import NODE_NAMES, Role
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.ros.contact_messages import pad_frame_of, taxel_values
from tactile_node.ros.message_age import MeasurementTime
from tactile_node.ros.message_checks import check_taxel_array
from tactile_node.ros.publishers import publisher_names
from tactile_node.ros.qos import frames_qos
from tactile_node.ros.time_messages import seconds
from tactile_node.taxel_frame import TaxelFrame
from tactile_skin.msg import TaxelArray

#: Time before a call of `RosGripper.advance` from which messages are still returned [s]. Older messages arrived while
#: the person answered a question.
KEPT_TIME = 0.1
MOST_WAITING = 2000   #: Largest number of messages that wait for `RosGripper.advance`. The oldest are dropped first.
CONNECT_TIME = LISTEN_TIME + 5.0  #: Time allowed for the first messages [s].
LOOK_PERIOD = 0.05    #: Time between two checks while the gripper is awaited [s].
ANSWER_TIME = 2.0     #: Time allowed for the answers to the last commands [s].
END_TIME = 2.0        #: Longest wait for the end of the last goal [s].
LIVE = GoalStatus.STATUS_ACCEPTED, GoalStatus.STATUS_EXECUTING, GoalStatus.STATUS_CANCELING


class _Frame(NamedTuple):
    """A taxel frame with the time of its arrival [s]."""

    arrived: float
    acquired: float
    sequence: int
    forces: np.ndarray


class _Position(NamedTuple):
    """A position of the joint with the time of its arrival [s]."""

    arrived: float
    measured: float
    value: float


class RosGripper:
    """A `CommissionedGripper` on ROS. Another thread has to spin the node.

    The columns of the forces are those of the device: if the driver mirrors the columns, the class mirrors them back. A
    commissioning therefore finds the same mounting before and after its parameters are applied.

    The heartbeat of touch_gripper is sent as well, so a touch_gripper on the same action does not close meanwhile.

    Parameters
    ----------
    node : Node
        Node that sends the commands and subscribes.
    action : str
        Name of the gripper's own action, a ParallelGripperCommand. A GripperCommand cannot be used, because it carries
        no speed.
    joint : str
        Name of the joint.
    joint_states : str
        Topic with the states of this joint.
    pads : sequence of str
        Names of the two pads. Each pad publishes on the topic <pad>/taxels.
    steady : callable
        Steady clock [s].

    Raises
    ------
    ConfigurationError
        Raised if control_msgs is not installed.
    """

    def __init__(self, node: Node, *, action: str, joint: str, joint_states: str, pads: Sequence[str],
                 steady: Callable[[], float] = time.monotonic):
        # A late import, because it takes 40 ms.
        from sensor_msgs.msg import JointState
        self._node, self._steady, self._joint, self._action = node, steady, joint, action
        self._interface = gripper_interface(PARALLEL, joint)
        self._lock = threading.Lock()
        self._frames: list[deque[_Frame]] = [deque(maxlen=MOST_WAITING) for _ in pads]
        self._positions: deque[_Position] = deque(maxlen=MOST_WAITING)
        self._measurements = MeasurementTime()
        self._measured = -math.inf         # time of the latest position [s]
        self._other_joints: set[str] = set()
        self._own: set[bytes] = set()      # IDs of the goals that were sent
        self._last = b''                   # ID of the latest of these goals
        self._live: frozenset[bytes] = frozenset()   # IDs of the live goals of all clients
        self._ended: frozenset[bytes] = frozenset()  # IDs of the goals that have ended, as long as they are reported
        self._answers: list[Any] = []      # futures of the last commands
        self._refusal = ''
        self.tap: list[TaxelFrame] | None = None  #: list for the published frames of the first pad, or None
        self._first: list[TaxelArray | None] = [None for _ in pads]
        self._client = LockedActionClient(node, self._interface.action, action)
        self._watch = DuplicateWatch(node, (f'{action}/touch_gripper',), steady=steady)
        self._status = node.create_subscription(GoalStatusArray, f'{action}/_action/status', self._on_status,
                                                qos_profile_action_status_default)
        self._states = node.create_subscription(JointState, joint_states, self._on_state, qos_profile_sensor_data)
        self._diagnostics = node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self._facts: list[dict[str, str]] = [{}, {}]  # values on /diagnostics; empty if not our driver
        self._taxels = [GuardedSubscription(node, TaxelArray, f'{pad}/taxels', partial(self._on_taxels, number),
                                            frames_qos(MOST_WAITING), check=check_taxel_array, steady=steady)
                        for number, pad in enumerate(pads)]

    def destroy(self) -> None:
        """Destroy the action client. Commands that were already sent continue."""
        self._client.destroy()

    def connect(self, seconds: float = CONNECT_TIME) -> PadGrid:
        """Wait for the gripper and for both pads, and return the size of the pads.

        The method also listens for a touch_gripper, whose heartbeat may take some seconds to be discovered.

        Raises
        ------
        ConfigurationError
            Raised if the action, the joint or a pad is missing, or if the pads differ or measure no force.
        """
        end = self._steady() + seconds
        while (missing := self._missing()) is not None or not self._watch.has_listened:
            if self._steady() > end and missing is not None:
                raise missing
            time.sleep(LOOK_PERIOD)
        grids = []
        for topic, first in zip(self._taxels, self._first):
            assert first is not None
            if first.unit not in ('Pa', 'N'):
                raise ConfigurationError(topic.topic, expected='taxels in Pa or N', got=f'the unit {first.unit!r}',
                                         remedy='On/off taxels measure no force, so they cannot be commissioned.')
            grids.append(PadGrid(first.rows, first.cols, float(first.pitch)))
        if grids[0] != grids[1]:
            raise ConfigurationError('pads', expected='two pads of the same size', got=f'{grids[0]} and {grids[1]}',
                                     remedy='Name the two pads of one gripper with --pads.')
        return grids[0]

    def now(self) -> float:
        return self._steady()

    def advance(self, seconds: float) -> Recording:
        """Wait, and return everything that was received meanwhile.

        Raises
        ------
        RefusedStepError
            Raised if the gripper has rejected a command, or if the server of its action is missing.
        """
        begun = self.now()
        time.sleep(seconds)
        if refusal := self._refusal:
            self._refusal = ''
            raise RefusedStepError('gripper', Mistake.COMMAND_REJECTED, expected='a gripper that accepts the command',
                                   got=refusal, remedy='Check the limits of the joint and of the effort, and the log '
                                   'of the controller of the gripper.')
        with self._lock:
            frames = [[each for each in waiting if each.arrived >= begun - KEPT_TIME] for waiting in self._frames]
            positions = [each for each in self._positions if each.arrived >= begun - KEPT_TIME]
            self._positions.clear()
            for waiting in self._frames:
                waiting.clear()
        left, right = (_pad_frames(each, first) for each, first in zip(frames, self._first))
        return Recording((left, right), JointStates(np.array([each.measured for each in positions]),
                                                    np.array([each.value for each in positions])))

    def command(self, position: float, effort: float, speed: float) -> None:
        """Send a goal. The next call of `advance` reports a rejected goal."""
        if not self._client.server_is_ready():
            self._refusal = f'no server of {self._action}'
        goal_id = self._last = uuid4().bytes
        self._own.add(goal_id)
        future = self._client.send_goal_async(self._interface.goal(GoalValues(position, speed, effort)),
                                              goal_uuid=UUID(uuid=list(goal_id)))
        self._expect(future)
        future.add_done_callback(partial(self._on_answer, position, effort, speed))

    def cancel(self) -> None:
        """Cancel the live goals of all clients by their IDs.

        A request to cancel all goals could overtake the next command, and would then cancel that command.
        """
        for goal_id in {*self._live, self._last} - {b''}:
            self._cancel(goal_id)

    def _cancel(self, goal_id: bytes) -> None:
        handle = ClientGoalHandle(self._client, UUID(uuid=list(goal_id)), None)
        self._expect(handle.cancel_goal_async())

    @property
    def first_frame(self) -> TaxelArray:
        """First frame of the first pad, as published."""
        assert self._first[0] is not None, 'the pads are connected'
        return self._first[0]

    def serial_numbers(self) -> tuple[str, str]:
        """Return the serial number of each pad, or '' if the driver does not publish it."""
        left, right = (facts.get('serial_number', '') for facts in self._facts)
        return left, right

    def others(self) -> str:
        """Return the other client or server of the gripper, or '' if there is none.

        A second server would move another gripper with the same commands.
        """
        if topics := self._watch.topics:
            return f'a touch_gripper or another commissioning, heard on {topics[0]}'
        if (servers := self._node.count_publishers(self._status.topic_name)) > 1:
            return f'{servers} servers of {self._action}'
        others = len(self._live - self._own)
        return f'{others} live goals of another client on {self._action}' if others else ''

    def settle(self) -> bool:
        """Wait until the last goal has ended and the gripper has answered. Return False if an answer is missing.

        A goal at the present position stays live while foam or an object keeps the joint from it. The next program
        would take this goal for that of another client, so the method cancels a goal that is not known to have ended.
        """
        self._wait_for_answers()
        end = self._steady() + END_TIME
        while self._last and self._last not in self._ended and self._steady() < end:
            time.sleep(LOOK_PERIOD)
        for goal_id in self._own & self._live | {self._last} - self._ended - {b''}:
            self._cancel(goal_id)
        return self._wait_for_answers()

    def _wait_for_answers(self) -> bool:
        end = self._steady() + ANSWER_TIME
        while not all(each.done() for each in self._answers) and self._steady() < end:
            time.sleep(LOOK_PERIOD)
        return all(each.done() for each in self._answers)

    def _expect(self, future: Any) -> None:
        self._answers = [each for each in self._answers if not each.done()] + [future]

    def _missing(self) -> ConfigurationError | None:
        """Return the error about the first part that is missing, or None."""
        if not self._client.server_is_ready():
            return ConfigurationError(f'action {self._action}', expected=f'a server of {PARALLEL}', got='none',
                                      remedy='Start the controller of the gripper, or give --action: `ros2 action '
                                      'list -t` lists all actions.')
        if not self._positions:
            return ConfigurationError(f'topic {self._states.topic_name}', expected=f'states of the joint {self._joint}',
                                      got=f'states of {", ".join(sorted(self._other_joints))}' if self._other_joints
                                      else 'no message', remedy='Start the joint state publisher, or correct --joint '
                                      'or --joint-states.')
        for subscription, frames in zip(self._taxels, self._frames):
            if not frames:
                return ConfigurationError(f'topic {subscription.topic}', expected='taxel frames of one driver',
                                          got=f'{subscription.counts.received} messages, of which none can be used',
                                          remedy='Start the driver, for example with `tactile bringup`, or correct '
                                          '--pads.')
        for subscription, facts in zip(self._taxels, self._facts):  # the columns may be mirrored
            driver = f'/{NODE_NAMES[Role.DRIVER]}'
            if not facts and any(name.endswith(driver) for name in publisher_names(self._node, subscription.topic)):
                return ConfigurationError('/diagnostics', expected=f'the state of the driver of {subscription.topic}',
                                          got='none', remedy='Check the network, and start this command again.')
        return None

    def _on_taxels(self, number: int, message: TaxelArray) -> None:
        acquired = self._taxels[number].acquired
        if not math.isfinite(acquired):  # the age is not known yet
            return
        if number == 0 and self.tap is not None:
            self.tap.append(TaxelFrame(seconds(message.header.stamp), message.sequence, taxel_values(message),
                                       pad_frame_of(message).status, message.missing_can_frames))
        first = self._first[number] = self._first[number] or message
        if (message.rows, message.cols, message.unit) != (first.rows, first.cols, first.unit):
            return  # another pad uses the name, so this pad counts as silent
        scale = float(message.pitch) ** 2 if message.unit == 'Pa' else 1.0
        forces = scale * taxel_values(message)
        if self._facts[number].get('mirrored') == 'True':
            forces = forces[:, ::-1]
        with self._lock:
            self._frames[number].append(_Frame(self._steady(), acquired, message.sequence, forces))

    def _on_state(self, message: Any) -> None:
        names = list(message.name)
        if self._joint not in names:
            self._other_joints |= set(names)
            return
        value = message.position[names.index(self._joint)] if len(message.position) == len(names) else math.nan
        now = self._steady()
        measured = self._measurements.of(seconds(message.header.stamp), now)
        with self._lock:
            if math.isfinite(value) and measured > self._measured:  # a repeated stamp is no new measurement
                self._measured = measured
                self._positions.append(_Position(now, measured, value))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for number, subscription in enumerate(self._taxels):
            pad = subscription.topic.split('/')[-2]
            names = [f'{driver}: {pad}' for driver in publisher_names(self._node, subscription.topic)]
            for status in message.status:
                if status.name in names:
                    self._facts[number] = {pair.key: pair.value for pair in status.values}

    def _on_status(self, message: GoalStatusArray) -> None:
        goals = {bytes(each.goal_info.goal_id.uuid): each.status in LIVE for each in message.status_list}
        self._live = frozenset(goal_id for goal_id, is_live in goals.items() if is_live)
        self._ended = frozenset(goals) - self._live

    def _on_answer(self, position: float, effort: float, speed: float, done: Any) -> None:
        if not done.result().accepted:
            self._refusal = (f'a rejected goal: position {position:.4g}, effort {effort:.3g}, speed {speed:.3g} on '
                             f'{self._action}')


def _pad_frames(frames: list[_Frame], first: TaxelArray | None) -> PadFrames:
    assert first is not None, 'the pads are connected'
    return PadFrames(np.array([each.acquired for each in frames]), np.array([each.sequence for each in frames], int),
                     np.array([each.forces for each in frames], float).reshape(-1, first.rows, first.cols))
