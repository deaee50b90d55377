"""Two pads, each on its own CAN bus, and a grasp node that sees both: as docs/hardware.md says."""

import time
from contextlib import ExitStack

import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from tactile_node.node_graph import bus_nodes
from tactile_node.nodes.grasp_node import GraspNode
from tactile_node.nodes.system import System
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.skin.pads import make_pad
from tactile_skin.msg import Grasp, TaxelArray

pytestmark = [pytest.mark.ros, pytest.mark.bus]

TIMEOUT = 60.0  # s, for a busy machine
FINGERS = {'left': ('two_buses_a', 'sim16x16.yaml', 50e3), 'right': ('two_buses_b', 'domain16x10_16bit.yaml', 60e3)}


def pressed(rows, cols, pressure):
    values = np.zeros((rows, cols))
    values[3:10, 2:9] = pressure
    return lambda t: values


@pytest.fixture
def fingers():
    rclpy.init()
    with ExitStack() as stack:
        stack.callback(rclpy.shutdown)
        executor = SingleThreadedExecutor()
        for name, (channel, layout, pressure) in FINGERS.items():
            pad = make_pad(name, 32, layout)
            skin = SkinSimulator([pad], {name: pressed(pad.layout.rows, pad.layout.cols, pressure)})
            skin.start('virtual', channel)
            stack.callback(skin.stop)
            driver = {'interface': 'virtual', 'channel': channel, 'node_ids': [32], 'layouts': [layout]}
            system = System(bus_nodes([name], driver=driver, namespace=f'{name}_finger'))
            stack.callback(system.destroy)
            for node in system.nodes:
                executor.add_node(node)
            system.driver.autostart()
        grasp = GraspNode(parameter_overrides=[Parameter(f'{name}_pad', value=f'{name}_finger/{name}')
                                               for name in FINGERS])
        listener = rclpy.create_node('listener')
        for node in (grasp, listener):
            stack.callback(node.destroy_node)
            executor.add_node(node)
        yield executor, listener
        executor.shutdown()


def test_both_come_and_the_grasp_sees_both(fingers):
    executor, listener = fingers
    heard = {name: [] for name in FINGERS}  # whole frames: a busy machine loses some
    grasps = []
    for name in FINGERS:
        listener.create_subscription(TaxelArray, f'{name}_finger/{name}/taxels',
                                     lambda frame, whole=heard[name]: frame.missing_can_frames or whole.append(frame),
                                     10)
    listener.create_subscription(Grasp, 'grasp', grasps.append, 10)
    end = time.monotonic() + TIMEOUT
    while not (all(heard.values()) and any(grasp.contact == Grasp.TWO_SIDED for grasp in grasps)):
        assert time.monotonic() < end, f'{ {name: len(given) for name, given in heard.items()} }, {grasps[-1:]}'
        executor.spin_once(timeout_sec=0.1)
    for name, (_, _, pressure) in FINGERS.items():
        assert max(heard[name][-1].values) == pytest.approx(pressure, rel=0.01)
