"""Test bench in which bench_grasps.py grasps one item.

The physics, the skin, the gripper's action server and the planner node run in this process. The programs `tactile
bringup` and `touch_gripper` run in their own processes, as on a robot. The simulation runs in real time and needs a
machine that is fast enough.
"""

import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from types import MappingProxyType
from typing import Any

import rclpy
from built_messages import environment_with
from control_msgs.action import ParallelGripperCommand
from planner_client import Correction, Planner, asked_for
from planner_world import AIM
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data

from examples.simulated_gripper.gripper_server import ACTION
from examples.simulated_gripper.session import JOINT, NODE_IDS, Bench
from examples.simulated_gripper.world import AXES, SIDES, Place, World
from tactile_node.gripper.rules.closing import Outcome as Ending
from tactile_node.gripper.touch_client import TouchClient
from tactile_node.nodes.spinner import spinning
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.message_age import InputAge
from tactile_skin.msg import ContactMotion, Grasp, GripperOutcome

#: Parameters of the gripper node. Each finger has a stiffness of 2000 N/m (drive.STIFFNESS) and moves by half the
#: change of the gap, so the stiffness of the gap is 1000 N/m.
PARAMETERS: Mapping[str, Any] = MappingProxyType({
    'gripper_action': ACTION, 'joint': JOINT, 'widest': 0.085, 'stiffness': 1000.0, 'latency': 0.1,
    'fast_speed': 0.02, 'slow_speed': 0.003, 'touch_force': 2.0, 'gripper_effort': 10.0})
HOLD: Mapping[str, Any] = MappingProxyType({
    **PARAMETERS, 'hold': True, 'slide_force_step': 1.0, 'hold_travel': 0.02, 'highest_force': 9.0})
TIMEOUT = 60.0  #: Longest wait for a condition [s].
LOOK = 0.005    #: Time between two checks of a condition [s].

#: Longest wait for the end of a goal [s]. If an item rocks between the pads, the gripper's own action never ends.
PATIENCE = 30.0


class WatchedWorld(World):
    """Simulated world that records the peak forces."""

    def __init__(self, *args: Any):
        self.watch()
        super().__init__(*args)

    def watch(self) -> None:
        """Clear the record."""
        self.peaks = dict.fromkeys(SIDES, 0.0)  #: [N]

    def _observe(self) -> None:
        super()._observe()
        self.peaks = {side: max(self.peaks[side], force) for side, force in self._forces.items()}


class PlannerNode(Node):
    """Planner node that receives grasps and outcomes, and sends goals to the gripper and to the gripper node."""

    def __init__(self) -> None:
        super().__init__('planner')
        self._planner, self._ages = Planner(), InputAge()
        self.grasp, self.holds = Grasp(), list[str]()
        self.moving = 0  #: all flags of ContactMotion.moving that either pad has reported, as a sum
        self.gripper, self.touch = ActionClient(self, ParallelGripperCommand, ACTION), TouchClient(self)
        self.create_subscription(Grasp, 'grasp', self._on_grasp, qos_profile_sensor_data)
        self.create_subscription(GripperOutcome, 'touch_gripper/outcome', self._on_outcome, 10)

    def decide(self) -> tuple[Correction, Grasp]:
        """Return the next correction and the latest grasp."""
        return self._planner.decide(time.monotonic()), self.grasp

    def _on_outcome(self, outcome: GripperOutcome) -> None:
        if outcome.of_hold:
            self.holds.append(Ending(outcome.outcome).name)

    def _on_grasp(self, grasp: Grasp) -> None:
        if check_grasp(grasp) is None:
            arrival = self._ages.arrived(grasp)
            self._planner.receive(asked_for(grasp, AIM), arrival.steady, arrival.age_on_arrival)
            self.grasp = grasp
            for motion in grasp.motions:
                self.moving |= motion.moving


class Session(ExitStack):
    """A context that runs one ``world`` with all its nodes. ``link`` is the path of the adapter's port."""

    def __init__(self, world: WatchedWorld, link: Path, parameters: Mapping[str, Any] = PARAMETERS):
        super().__init__()
        self.world, self._link, self._parameters = world, link, parameters

    def __enter__(self) -> 'Session':
        super().__enter__()
        try:
            self._open()
        except BaseException:
            self.close()
            raise
        return self

    def _open(self) -> None:
        self._bench = self.enter_context(Bench(self.world, str(self._link)))
        self._node = PlannerNode()
        self.callback(self._node.destroy_node)
        self.enter_context(spinning([self._node]))
        self._start(Path(sys.prefix, 'bin/tactile'), 'bringup', '--interface', 'slcan', '--channel', self._link,
                    '--pads', ','.join(SIDES), '--node-id', ','.join(map(str, NODE_IDS)),
                    '--gap-source', 'joint_states', '--gap-joints', JOINT)
        self._start(sys.executable, '-m', 'tactile_node.gripper.gripper_node', '--ros-args', *(
            word for name, value in self._parameters.items() for word in ('-p', f'{name}:={value}')))
        self.until(lambda: self._node.gripper.server_is_ready() and self._node.touch.is_ready)
        self.until_open()
        self.wait(1.0)  # give each process time to estimate the age of its frames

    def _start(self, *words: Any) -> None:
        process = subprocess.Popen([*map(str, words)], env=environment_with('control_msgs'))
        self.callback(process.wait)
        self.callback(process.terminate)

    def until(self, condition: Callable[[], object]) -> None:
        """Wait until ``condition`` is true, and raise TimeoutError after TIMEOUT."""
        end = time.monotonic() + TIMEOUT
        while not condition():
            if time.monotonic() > end or self._bench.failures:
                raise TimeoutError(f'{self._bench.failures or "nothing happens"}: {self._bench.report()}')
            time.sleep(LOOK)

    def until_open(self) -> None:
        """Wait until a fresh grasp reports empty pads and the gripper's true gap."""
        self.until(lambda: self._node.grasp.fresh and self._node.grasp.contact == Grasp.NO_CONTACT
                   and abs(self._node.grasp.gap - self.world.gap) < 5e-4)

    def wait(self, seconds: float) -> None:
        """Wait for ``seconds`` of simulated time."""
        end = self.world.now + seconds
        self.until(lambda: self.world.now >= end)

    def place(self, place: Place) -> None:
        """Start again with the item at ``place`` and an open hand, and wait until both pads are reported as empty."""
        self.world.place(place)
        self.world.watch()
        self.hand = dict.fromkeys(AXES, 0.0)  #: goal of each axis
        self.until_open()

    def move(self, **goals: float) -> None:
        """Move the hand, and wait until it has reached ``goals``."""
        self.hand |= goals
        self.world.move(**goals)
        self.until(lambda: not self.world.is_moving)
        self.wait(0.1)

    def drive(self, position: float, *, effort: float = 0.0, touch: bool = False) -> str:
        """Move the gripper to a gap, and return the outcome. With ``touch``, the goal goes to the gripper node."""
        end = time.monotonic() + PATIENCE
        if touch:
            sent = self._node.touch.send(position, effort=effort)
            self.until(lambda: sent.ending or time.monotonic() > end)
            if sent.ending is None:
                return 'UNDER_WAY'
            return 'OUTCOME_LOST' if sent.ending.outcome is None else Ending(sent.ending.outcome.outcome).name
        goal = ParallelGripperCommand.Goal()
        goal.command.position, goal.command.effort = [position], [effort]
        accepted = self._node.gripper.send_goal_async(goal)
        self.until(accepted.done)
        result = accepted.result().get_result_async()
        self.until(lambda: result.done() or time.monotonic() > end)
        if not result.done():
            return 'UNDER_WAY'
        return 'STALLED' if result.result().result.stalled else 'REACHED'

    @property
    def holds(self) -> list[str]:
        """Names of the outcomes of all holds so far."""
        return self._node.holds

    def moved(self) -> list[str]:
        """Return the names of the movements that either pad has reported since the previous call."""
        moving, self._node.moving = self._node.moving, 0
        return [name for name in ('SHIFTING', 'SLIDING', 'TURNING') if moving & getattr(ContactMotion, name)]

    def decide(self) -> tuple[Correction, Grasp]:
        return self._node.decide()


def started_rclpy() -> ExitStack:
    """Return a context with rclpy, but without the signal handlers that would shut rclpy down before the nodes."""
    stack = ExitStack()
    rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    stack.callback(rclpy.try_shutdown)
    return stack
