"""Run the bench as a planner sees it: a CANopen skin behind a serial adapter, joint states, frames and commands."""

import threading
from importlib.util import find_spec

import numpy as np
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState

from bench.planner_world import noisy
from examples.simulated_gripper.hand_interface import HandInterface
from examples.simulated_gripper.world import SIDES, World
from tactile_node.simulator.device import TaxelSource
from tactile_node.simulator.skin_simulator import SkinSimulator, WireSettings
from tactile_node.simulator.slcan_pty import SlcanPty
from tactile_node.skin.pads import make_pad

NODE_IDS, LAYOUT, NODE = (32, 64), 'sim16x16.yaml', 'simulated_gripper'
JOINT = 'hand_gap'
STATE_PERIOD = 0.02  #: publishing period of the joint states [s]
HAS_ACTION = find_spec('control_msgs') is not None  #: without control_msgs, only `world` can command the gripper


def joint_state(node: Node, world: World) -> JointState:
    """Return the gap [m], its speed [m/s] and the effort [N] as the state of one joint."""
    state = JointState(name=[JOINT], position=[world.gap], velocity=[world.gap_speed], effort=[world.effort])
    state.header.stamp = node.get_clock().now().to_msg()
    return state


class Bench:
    """A context in which ``world`` runs in real time, while other processes read its skin and command its gripper.

    rclpy must be initialised.

    Parameters
    ----------
    world
        Simulated world.
    link
        Path of a symbolic link to the adapter's port, or an empty string for no link.
    seed
        Seed for the noise of the taxels and the jitter of the bus.
    """

    def __init__(self, world: World, link: str = '', seed: int = 0):
        self.world = world
        self.failures: list[Exception] = []  #: errors of the simulated bus
        pads = [make_pad(side, node_id, LAYOUT) for side, node_id in zip(SIDES, NODE_IDS)]
        sources = {side: self._source(side, np.random.default_rng((seed, number)))
                   for number, side in enumerate(SIDES)}
        self.skin = SkinSimulator(pads, sources, self.failures.append, WireSettings(seed=seed))
        self._link = link

    def __enter__(self) -> 'Bench':
        adapter = SlcanPty(self._link)
        self.port = self._link or adapter.port
        self.world.start()
        self.skin.start_on(adapter)
        self._node = rclpy.create_node(NODE)
        self._start_node()
        return self

    def __exit__(self, *exception: object) -> None:
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()
        self.skin.stop()
        self.world.stop()

    def report(self) -> str:
        """Return a report about the bus, and the time that the simulation skipped because the machine was too slow."""
        wire = self.skin.report()
        return f'{wire.text() if wire else ""}\nphysics: {self.world.now:.1f} s, {self.world.left_out:.1f} s left out'

    def _start_node(self) -> None:
        publisher = self._node.create_publisher(JointState, 'joint_states', 10)
        self._node.create_timer(STATE_PERIOD, lambda: publisher.publish(joint_state(self._node, self.world)),
                                clock=Clock(clock_type=ClockType.STEADY_TIME))
        HandInterface(self._node, self.world)
        if HAS_ACTION:
            from examples.simulated_gripper.gripper_server import GripperServer
            self._server = GripperServer(self._node, self.world)
        self._executor = MultiThreadedExecutor(num_threads=4)  # several threads, because each goal blocks one
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._executor.spin, name='executor')
        self._thread.start()

    def _source(self, side: str, random: np.random.Generator) -> TaxelSource:
        return lambda _: noisy(self.world.pressures(side), random)
