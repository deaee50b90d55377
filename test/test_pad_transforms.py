"""The node publishes the frames of the pads on tf, without a URDF.

The node publishes a pad frame only while the true pose of the pad is known.
"""

import logging
import sys
from math import pi

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped
from opening_bench import OpeningBench
from rclpy.parameter import Parameter
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.gripper import Gripper, PadPose
from tactile_node.grasp.opening import GapSource, Opening
from tactile_node.nodes.pad_transforms import TRANSFORM_PERIOD, publish_pad_frames
from tactile_node.ros.opening_messages import quaternion
from tactile_node.ros.parameters import read
from tactile_node.ros.qos import TF_QOS, TF_STATIC_QOS
from tactile_node.ros.settings import GraspNodeSettings

pytestmark = [pytest.mark.ros, pytest.mark.bus]

#: Value of the parameter max_gap_age [s].
LIMIT = 0.3
#: Poses of the pads in urdf/example_gripper.urdf.xacro.
POSES = {'left_xyz': [-0.015, 0.0, 0.145], 'left_rpy': [-pi / 2, 0.0, 0.0],
         'right_xyz': [-0.015, 0.0, 0.115], 'right_rpy': [pi / 2, 0.0, 0.0]}
JOINTS = {'gap_source': 'joint_states', 'gap_joints': ['finger']}


class FrameGripper(OpeningBench):
    """A node that publishes the pad frames, and a node that receives them."""

    def __init__(self, stack, *topics):
        super().__init__(stack, topics, closing=(0.0, 1.0, 0.0))

    def make(self, source=None, **parameters):
        super().make(**{'publish_pad_frames': True, **POSES, **parameters})
        settings = read(self.node, GraspNodeSettings)
        gripper = Gripper(PadPose(settings.left_xyz, settings.left_rpy),
                          PadPose(settings.right_xyz, settings.right_rpy))
        publish_pad_frames(self.node, settings, gripper, source or self.source, self.steady)

    def listen(self, kind, topic, qos, readers=1):
        """Return a list that collects each message as {frame: transform}, once the topic has ``readers``."""
        heard = []
        self.publishing.create_subscription(
            kind, topic, lambda given: heard.append({each.child_frame_id: each for each in given.transforms}), qos)
        publisher, = (each for each in self.node.publishers if each.topic_name == topic)
        self.until_joined(lambda: publisher.get_subscription_count() == readers)
        return heard


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
    gripper.until_joined(lambda: heard)
    check(heard[-1], 0.04)
    gripper.wait(0.3)
    assert len(heard) == 1  # The node publishes the frames only once.
    assert gripper.node.set_parameters([Parameter('gap', value=0.01)])[0].successful
    gripper.wait(TRANSFORM_PERIOD)
    assert len(heard) == 2
    check(heard[-1], 0.01)


def test_there_are_no_frames_without_an_opening(gripper, tf_message):
    gripper.make()
    heard = gripper.listen(tf_message, '/tf_static', TF_STATIC_QOS)
    gripper.wait(1.0)
    assert not heard
    gripper.node.set_parameters([Parameter('gap', value=0.0)])
    gripper.wait(TRANSFORM_PERIOD)
    check(heard[-1], 0.0)


def test_the_frames_at_a_measured_opening_move_and_stop_with_the_opening(ros, tf_message):
    gripper = FrameGripper(ros, (JointState, '/joint_states', 10))
    gripper.make(**JOINTS, frame_prefix='robot1/', pad_frames=['a', 'b'])
    heard = gripper.listen(tf_message, '/tf', TF_QOS)
    gripper.wait(0.5)
    assert not heard
    for i in range(20):
        gripper.publish(JointState(name=['finger'], position=[0.002 * i]))
        gripper.wait(TRANSFORM_PERIOD)
    gripper.wait(2 * LIMIT)
    assert len(heard) == 20  # The node publishes each measurement once.
    check(heard[-1], 0.038, 'robot1/gripper', ('robot1/a', 'robot1/b'))
    stamps = [each['robot1/a'].header.stamp for each in heard]
    # tf2 drops frames with repeated stamps.
    assert all((a.sec, a.nanosec) < (b.sec, b.nanosec) for a, b in zip(stamps, stamps[1:]))


def test_the_frames_at_an_opening_from_tf_follow_the_fingers_and_not_themselves(ros, tf_message):
    gripper = FrameGripper(ros, (tf_message, '/tf', TF_QOS))
    gripper.make(gap_source='tf', gap_frames=['left_finger', 'right_finger'], gap_offset=-0.02)
    heard = gripper.listen(tf_message, '/tf', TF_QOS, readers=2)  # The node reads the topic, too.
    for _ in range(10):
        fingers = [TransformStamped(child_frame_id=f'{side}_finger') for side in ('left', 'right')]
        for finger, y in zip(fingers, (-0.025, 0.025)):
            finger.header.frame_id = 'gripper'
            finger.transform.translation.y = y
        gripper.publish(tf_message(transforms=fingers))
        gripper.wait(TRANSFORM_PERIOD)
    gripper.wait(2 * LIMIT)
    of_pads = [each for each in heard if 'left_pad' in each]
    assert len(of_pads) == 10
    check(of_pads[-1], 0.030)


def test_a_measurement_that_is_read_slowly_is_published_once(gripper, tf_message):
    measured, reads = gripper.steady(), []

    class SlowSource:
        def current(self):
            reads.append(gripper.steady())
            if len(reads) % 2:
                gripper.time.nanoseconds += 20_000_000  # The clock advances while the opening is read.
            return Opening(0.03, GapSource.TF, gripper.steady() - measured)

    gripper.make(SlowSource(), gap_source='tf', gap_frames=['left_finger', 'right_finger'])
    heard = gripper.listen(tf_message, '/tf', TF_QOS, readers=2)
    gripper.wait(0.5)
    assert len(reads) >= 8 and len(heard) == 1


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
