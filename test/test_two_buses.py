"""Two pads, each on its own CAN bus, and a grasp node that receives both, as docs/hardware.md describes."""

import numpy as np
import pytest
from rclpy.parameter import Parameter
from ros_bench import RosBench

from tactile_node.node_graph import bus_nodes
from tactile_node.nodes.grasp_node import GraspNode
from tactile_node.nodes.system import System
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.skin.pads import make_pad
from tactile_skin.msg import Grasp, TaxelArray

pytestmark = [pytest.mark.ros, pytest.mark.bus]

SYNC_PERIOD = 0.1  #: Long, so that a busy machine has the processor time for both buses [s].
MAX_AGE = 5.0  #: Age and skew of the pads' results up to which a grasp is fresh, also on a busy machine [s].

FINGERS = {'left': ('two_buses_a', 'sim16x16.yaml', 50e3), 'right': ('two_buses_b', 'domain16x10_16bit.yaml', 60e3)}


def pressed(rows, cols, pressure):
    values = np.zeros((rows, cols))
    values[3:10, 2:9] = pressure
    return lambda t: values


@pytest.fixture
def fingers(ros):
    bench = RosBench(ros)
    for name, (channel, layout, pressure) in FINGERS.items():
        pad = make_pad(name, 32, layout)
        skin = SkinSimulator([pad], {name: pressed(pad.layout.rows, pad.layout.cols, pressure)})
        skin.start('virtual', channel)
        ros.callback(skin.stop)
        driver = {'interface': 'virtual', 'channel': channel, 'node_ids': [32], 'layouts': [layout],
                  'sync_period': SYNC_PERIOD}
        system = System(bus_nodes([name], driver=driver, namespace=f'{name}_finger'))
        ros.callback(system.destroy)
        for node in system.nodes:
            bench.executor.add_node(node)
        system.driver.autostart()
    bench.add(GraspNode(parameter_overrides=[
        Parameter('max_skew', value=MAX_AGE), Parameter('max_age', value=MAX_AGE),
        *(Parameter(f'{name}_pad', value=f'{name}_finger/{name}') for name in FINGERS)]))
    return bench


def test_both_come_and_the_grasp_sees_both(fingers):
    listener = fingers.add('listener')
    heard = {name: [] for name in FINGERS}  # The test keeps only whole frames, because a busy machine loses some TPDOs.
    grasps = []
    for name in FINGERS:
        listener.create_subscription(TaxelArray, f'{name}_finger/{name}/taxels',
                                     lambda frame, whole=heard[name]: frame.missing_can_frames or whole.append(frame),
                                     10)
    listener.create_subscription(Grasp, 'grasp', grasps.append, 10)
    fingers.until(lambda: all(heard.values()) and any(grasp.contact == Grasp.TWO_SIDED for grasp in grasps))
    for name, (_, _, pressure) in FINGERS.items():
        assert max(heard[name][-1].values) == pytest.approx(pressure, rel=0.01)
