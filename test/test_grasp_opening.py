"""Tests of the whole chain with a simulated gripper that moves.

No Grasp message may have a wrong or old opening. The pads are placed as in urdf/example_gripper.urdf.xacro. A square of
6 x 6 taxels with a pitch of 2 mm presses on each pad. The middle of the left square is at column 8.5, row 7.5, and the
right square lies three columns further on. The contacts are therefore 6 mm apart across the closing direction.
"""

import time
from math import atan2, hypot, isfinite, isnan, pi

import numpy as np
import pytest
from ros_bench import TIMEOUT, RosBench
from sensor_msgs.msg import JointState

from tactile_node.node_graph import bus_nodes
from tactile_node.nodes.system import System
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.message_age import age_seconds
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.skin.pads import make_pad
from tactile_skin.msg import Grasp

pytestmark = [pytest.mark.ros, pytest.mark.bus]

LIMIT = 0.3  # Value of the parameter max_gap_age [s].
JOINTS = ['left_finger_joint', 'right_finger_joint']
GRASP = {'gap_source': 'joint_states', 'gap_joints': JOINTS, 'max_gap_age': LIMIT,
         'left_xyz': [-0.015, 0.0, 0.145], 'left_rpy': [-pi / 2, 0.0, 0.0],
         'right_xyz': [-0.015, 0.0, 0.115], 'right_rpy': [pi / 2, 0.0, 0.0]}
ACROSS = 0.006  # Distance between the contacts across the closing direction [m].
PLACE = 0.0005  # Tolerance for the centre of a contact [m].


def square(column):
    values = np.zeros((16, 16))
    values[5:11, column:column + 6] = 60e3
    return lambda t: values


class World(RosBench):
    """The nodes for a gripper with two pads, and the messages that one consumer receives."""

    def __init__(self, stack):
        super().__init__(stack)
        channel = 'grasp_opening'
        pads = [make_pad('left', 32, 'sim16x16.yaml'), make_pad('right', 64, 'sim16x16.yaml')]
        skin = SkinSimulator(pads, {'left': square(6), 'right': square(9)})
        skin.start('virtual', channel)
        stack.callback(skin.stop)
        system = System(bus_nodes(['left', 'right'], grasp=GRASP, driver={
            'interface': 'virtual', 'channel': channel, 'node_ids': [32, 64], 'layouts': ['sim16x16.yaml'],
            # The SYNC period [s] is long, because the chain, the skins and the consumer share one process.
            'sync_period': 0.1}))
        stack.callback(system.destroy)
        beside = self.add('beside')
        for node in system.nodes:
            self.executor.add_node(node)
        self.grasps = []
        beside.create_subscription(Grasp, 'grasp', self.grasps.append, 10)
        self.joints = beside.create_publisher(JointState, '/joint_states', 10)
        self.clock = beside.get_clock()
        system.driver.autostart()
        self.system = system

    def move(self, opening):
        half = opening / 2
        message = JointState(name=JOINTS, position=[half, half])
        message.header.stamp = self.clock.now().to_msg()
        self.joints.publish(message)

    def spin(self, seconds, opening=None):
        """Run for ``seconds`` while the gripper reports ``opening`` every 30 ms."""
        end, due = time.monotonic() + seconds, 0.0
        while time.monotonic() < end:
            if opening is not None and time.monotonic() >= due:
                self.move(opening)
                due = time.monotonic() + 0.03
            self.executor.spin_once(timeout_sec=0.005)

    def spin_until(self, condition, opening):
        end = time.monotonic() + TIMEOUT
        while not (self.grasps and condition(self.grasps[-1])):
            assert time.monotonic() < end, self.grasps[-1:]
            self.spin(0.05, opening)


@pytest.fixture
def world(ros):
    return World(ros)


def check_place(grasp, gap):
    """Check a grasp against the drawing, in which the left square is 17 mm from column 0 and 15 mm from row 0."""
    assert grasp.gap == pytest.approx(gap) and grasp.gap_source == Grasp.GAP_JOINT_STATES
    left, right = grasp.left_centre, grasp.right_centre
    assert (left.x, left.y, left.z) == pytest.approx((0.002, -gap / 2, 0.130), abs=PLACE)
    assert (right.x, right.y, right.z) == pytest.approx((0.008, gap / 2, 0.130), abs=PLACE)
    assert grasp.offset == pytest.approx(ACROSS, abs=2 * PLACE)
    assert grasp.width == pytest.approx(hypot(gap, ACROSS), abs=2 * PLACE)
    assert grasp.misalignment == pytest.approx(atan2(ACROSS, gap), abs=2 * PLACE / gap)
    assert grasp.midpoint.y == pytest.approx(0, abs=1e-9)


def two_sided(grasp):
    return grasp.contact == Grasp.TWO_SIDED and grasp.fresh


def test_no_grasp_has_a_wrong_or_an_old_opening(world):
    world.spin_until(two_sided, None)
    first = list(world.grasps)
    assert all(isnan(grasp.gap) and isnan(grasp.width) and isnan(grasp.midpoint.x) for grasp in first)
    assert first[-1].offset == pytest.approx(ACROSS, abs=2 * PLACE)

    world.spin_until(lambda grasp: two_sided(grasp) and isfinite(grasp.width), 0.040)
    check_place(world.grasps[-1], 0.040)

    # When the opening jumps, each message must be consistent and have either the old or the new opening.
    before = len(world.grasps)
    world.spin_until(lambda grasp: two_sided(grasp) and grasp.gap == pytest.approx(0.020), 0.020)
    openings = [grasp for grasp in world.grasps[before:] if isfinite(grasp.gap)]
    jumped = next(i for i, grasp in enumerate(openings) if grasp.gap == pytest.approx(0.020))
    for number, grasp in enumerate(openings):
        assert grasp.gap == pytest.approx(0.020 if number >= jumped else 0.040)
        if two_sided(grasp):
            check_place(grasp, grasp.gap)

    world.spin_until(lambda grasp: isnan(grasp.gap), None)  # The joint states stop, but the shapes continue.
    ended = len(world.grasps)
    world.spin_until(lambda grasp: len(world.grasps) > ended + 10 and two_sided(grasp), None)
    assert all(isnan(grasp.gap) for grasp in world.grasps[ended:])
    for grasp in world.grasps[before:]:
        assert not isfinite(grasp.gap) or age_seconds(grasp.gap_age) <= LIMIT
        assert isnan(grasp.width) or isfinite(grasp.gap)
    last = world.grasps[-1]
    assert last.gap_source == Grasp.GAP_JOINT_STATES and age_seconds(last.gap_age) > LIMIT
    assert all(check_grasp(grasp) is None for grasp in world.grasps)


def test_when_the_shapes_stop_the_latest_grasp_has_the_present_opening(world):
    world.spin_until(lambda grasp: two_sided(grasp) and isfinite(grasp.width), 0.040)
    world.system.driver.trigger_deactivate()
    world.spin_until(lambda grasp: not grasp.fresh and grasp.gap == pytest.approx(0.060), 0.060)
    assert isnan(world.grasps[-1].width)
    world.spin_until(lambda grasp: isnan(grasp.gap), None)
