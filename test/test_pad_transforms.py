"""The node publishes the frames of the pads on tf, without a URDF.

The node publishes a pad frame only while the true pose of the pad is known.
"""

import logging
import sys
import time
from math import pi

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import TransformStamped
from rclpy.parameter import Parameter
from ros_bench import TIMEOUT, RosBench
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.gripper import Gripper, PadPose
from tactile_node.grasp.opening import GapSource, Opening
from tactile_node.nodes.opening_source import make_opening_source
from tactile_node.nodes.pad_transforms import publish_pad_frames
from tactile_node.ros.opening_messages import quaternion
from tactile_node.ros.parameters import declare, read
from tactile_node.ros.qos import TF_QOS, TF_STATIC_QOS
from tactile_node.ros.settings import GraspNodeSettings

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.slow]

#: Value of the parameter max_gap_age [s].
LIMIT = 0.3
#: Poses of the pads in urdf/example_gripper.urdf.xacro.
POSES = {'left_xyz': [-0.015, 0.0, 0.145], 'left_rpy': [-pi / 2, 0.0, 0.0],
         'right_xyz': [-0.015, 0.0, 0.115], 'right_rpy': [pi / 2, 0.0, 0.0]}
JOINTS = {'gap_source': 'joint_states', 'gap_joints': ['finger']}


class FrameGripper(RosBench):
    """A node that publishes the pad frames, and a node that receives them."""

    def __init__(self, stack):
        super().__init__(stack)
        self.beside = self.add('beside')

    def make(self, source=None, **parameters):
        overrides = [Parameter(name, value=value)
                     for name, value in {'publish_pad_frames': True, **POSES, **parameters}.items()]
        self.node = self.add(rclpy.create_node('grasp', parameter_overrides=overrides))
        declare(self.node, GraspNodeSettings)
        settings = read(self.node, GraspNodeSettings)
        gripper = Gripper(PadPose(settings.left_xyz, settings.left_rpy),
                          PadPose(settings.right_xyz, settings.right_rpy))
        publish_pad_frames(self.node, settings, gripper,
                           source or make_opening_source(self.node, settings, gripper.closing))

    def listen(self, kind, topic, qos):
        """Return a list that collects each message as {frame: transform}."""
        heard = []
        self.beside.create_subscription(
            kind, topic, lambda given: heard.append({each.child_frame_id: each for each in given.transforms}), qos)
        return heard

    def wait_for(self, heard, count=1):
        self.until(lambda: len(heard) >= count, 'no transforms')
        return heard[-1]

    def wait_for_the_end(self, heard):
        """Wait until no message has arrived for twice the time for which an opening stays valid."""
        end, before = time.monotonic() + TIMEOUT, -1
        while len(heard) > before:
            assert time.monotonic() < end, 'the messages do not stop'
            before = len(heard)
            self.wait(2 * LIMIT)


@pytest.fixture
def gripper(ros):
    return FrameGripper(ros)


def origin(transform):
    place = transform.transform.translation
    return place.x, place.y, place.z


def check(transforms, gap, parent='gripper', names=('left_pad', 'right_pad')):
    """Compare the pad frames with the drawing of the example gripper, as in test_urdf.py."""
    left, right = (transforms[name] for name in names)
    assert len(transforms) == 2 and {each.header.frame_id for each in (left, right)} == {parent}
    assert origin(left) == pytest.approx((-0.015, -gap / 2, 0.145))
    assert origin(right) == pytest.approx((-0.015, gap / 2, 0.115))
    turn = left.transform.rotation
    assert Rotation.from_quat((turn.x, turn.y, turn.z, turn.w)).apply((0, 0, 1)) == pytest.approx([0, 1, 0])


def test_the_frames_at_a_given_opening_are_static_and_reach_late_subscribers(gripper, tf_message):
    gripper.make(gap=0.04)
    gripper.wait(0.5)
    heard = gripper.listen(tf_message, '/tf_static', TF_STATIC_QOS)
    check(gripper.wait_for(heard), 0.04)
    gripper.wait(0.3)
    assert len(heard) == 1  # The node publishes the frames only once.
    assert gripper.node.set_parameters([Parameter('gap', value=0.01)])[0].successful
    check(gripper.wait_for(heard, 2), 0.01)


def test_there_are_no_frames_without_an_opening(gripper, tf_message):
    gripper.make()
    heard = gripper.listen(tf_message, '/tf_static', TF_STATIC_QOS)
    gripper.wait(1.0)
    assert not heard
    gripper.node.set_parameters([Parameter('gap', value=0.0)])
    check(gripper.wait_for(heard), 0.0)


def test_the_frames_at_a_measured_opening_move_and_stop_with_the_opening(gripper, tf_message):
    gripper.make(**JOINTS, frame_prefix='robot1/', pad_frames=['a', 'b'])
    heard = gripper.listen(tf_message, '/tf', TF_QOS)
    publisher = gripper.beside.create_publisher(JointState, '/joint_states', 10)
    gripper.wait(0.5)
    assert not heard
    for i in range(20):
        publisher.publish(JointState(name=['finger'], position=[0.002 * i]))
        gripper.wait(0.05)
    gripper.wait_for_the_end(heard)
    check(heard[-1], 0.038, 'robot1/gripper', ('robot1/a', 'robot1/b'))
    stamps = [each['robot1/a'].header.stamp for each in heard]
    assert len(stamps) > 2
    # tf2 drops frames with repeated stamps.
    assert all((a.sec, a.nanosec) < (b.sec, b.nanosec) for a, b in zip(stamps, stamps[1:]))


def test_the_frames_at_an_opening_from_tf_follow_the_fingers_and_not_themselves(gripper, tf_message):
    gripper.make(gap_source='tf', gap_frames=['left_finger', 'right_finger'], gap_offset=-0.02)
    heard = gripper.listen(tf_message, '/tf', TF_QOS)
    publisher = gripper.beside.create_publisher(tf_message, '/tf', TF_QOS)

    def of_pads():
        return [each for each in heard if 'left_pad' in each]
    gripper.wait(0.5)
    for _ in range(10):
        fingers = [TransformStamped(child_frame_id=f'{side}_finger') for side in ('left', 'right')]
        for finger, y in zip(fingers, (-0.025, 0.025)):
            finger.header.frame_id = 'gripper'
            finger.transform.translation.y = y
        publisher.publish(tf_message(transforms=fingers))
        gripper.wait(0.05)
    gripper.wait_for_the_end(heard)
    check(of_pads()[-1], 0.030)
    # The node publishes one message per measurement, and no message after the last measurement.
    assert len(of_pads()) <= 10


def test_a_measurement_that_is_read_slowly_is_published_once(gripper, tf_message):
    measured = time.monotonic()
    reads = []

    class SlowSource:
        def current(self):
            reads.append(time.monotonic())
            if len(reads) % 2:
                time.sleep(0.02)
            return Opening(0.03, GapSource.TF, time.monotonic() - measured)

    gripper.make(SlowSource(), gap_source='tf', gap_frames=['left_finger', 'right_finger'])
    heard = gripper.listen(tf_message, '/tf', TF_QOS)
    gripper.until(lambda: len(reads) >= 8)
    gripper.wait(0.1)
    assert len(heard) <= 1


@pytest.mark.parametrize('parameters', [
    {'gap_source': 'none'}, {'pad_frames': ['pad', 'pad']}, {'pad_frames': ['gripper', 'pad']},
    {'gap_source': 'tf', 'gap_frames': ['left_pad', 'right_pad']}])
def test_frames_that_cannot_be_published_are_refused(gripper, tf_message, parameters):
    with pytest.raises(ConfigurationError, match='publish_pad_frames'):
        gripper.make(**parameters)


@pytest.mark.parametrize('frames', [['pad'], ['a', 'b', 'c']])
def test_frames_for_another_number_of_pads_are_refused(gripper, frames):
    with pytest.raises(ConfigurationError, match='pad_frames: expected one frame for the left .*got .* Name both'):
        gripper.make(pad_frames=frames)


def test_a_missing_tf2_msgs_causes_a_warning_and_the_node_runs(gripper, monkeypatch, caplog):
    monkeypatch.setitem(sys.modules, 'tf2_msgs', None)
    monkeypatch.setitem(sys.modules, 'tf2_msgs.msg', None)
    with caplog.at_level(logging.WARNING, logger='tactile_node'):
        gripper.make(gap=0.04)
    assert any('tf2_msgs' in record.getMessage() for record in caplog.records)


@pytest.mark.parametrize('rpy', [(0.1, -0.7, 2.9), (pi, 0.0, 0.0), (-1.0, 1.5, -3.0), (0.0, 0.0, pi)])
def test_roll_pitch_yaw_as_a_quaternion(rpy):
    q = quaternion(*rpy)
    expected = Rotation.from_euler('xyz', rpy)
    assert np.abs(expected.as_quat() @ (q.x, q.y, q.z, q.w)) == pytest.approx(1)
