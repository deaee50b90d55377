"""A running node takes the gripper's opening from tf. In some cases, the opening must be unknown."""

from math import cos, inf, isnan, nan, pi, sin

import pytest
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from opening_bench import PERIOD, OpeningBench

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.opening import UNKNOWN_OPENING, GapSource
from tactile_node.nodes import opening_source
from tactile_node.ros.qos import TF_QOS, TF_STATIC_QOS
from tactile_node.ros.time_messages import time_message
from tactile_node.skin.taxel_array import RejectReason as R

pytestmark = [pytest.mark.ros, pytest.mark.bus]

#: Value of the parameter max_gap_age [s].
LIMIT = 0.3
#: The fingers slide along the y axis of the hand. Their frames are 12 mm apart when the hand is closed.
PARAMETERS = {'gap_source': 'tf', 'frame_id': 'hand', 'gap_frames': ['left_finger', '/right_finger'],
              'gap_offset': -0.012}


def transform(frame, parent, x=0.0, y=0.0, z=0.0, rotation=(0.0, 0.0, 0.0, 1.0), stamp=0.0):
    made = TransformStamped(child_frame_id=frame)
    made.header.frame_id = parent
    made.header.stamp = time_message(stamp)
    made.transform.translation = Vector3(x=x, y=y, z=z)
    made.transform.rotation = Quaternion(**dict(zip('xyzw', rotation)))
    return made


def fingers(left, right, stamp=0.0):
    return [transform('left_finger', 'hand', y=-left, stamp=stamp),
            transform('right_finger', 'hand', y=right, stamp=stamp)]


class Robot(OpeningBench):
    """A node with a source of the opening, and a second node that publishes tf."""

    def __init__(self, stack, kind, **more):
        super().__init__(stack, [(kind, '/tf', TF_QOS), (kind, '/tf_static', TF_STATIC_QOS)], closing=(0.0, 1.0, 0.0))
        self._kind = kind
        self.make(**{**PARAMETERS, **more})

    def send(self, *transforms, static=False):
        return self.publish(self._kind(transforms=transforms), static)


@pytest.fixture
def robot(ros, tf_message):
    return Robot(ros, tf_message)


def test_the_distance_of_the_fingers_along_the_closing_direction(robot):
    assert robot.current() is UNKNOWN_OPENING
    opening = robot.send(*fingers(0.020, 0.030))
    assert opening.gap == pytest.approx(0.050 - 0.012) and opening.source is GapSource.TF and opening.age == 0
    # A movement across the closing direction does not change the opening.
    opening = robot.send(transform('left_finger', 'hand', x=0.004, y=-0.010, z=0.03))
    assert opening.gap == pytest.approx(0.040 - 0.012)


def test_a_hand_that_is_mounted_askew_and_fingers_that_are_turned(robot):
    eighth = (0.0, 0.0, sin(pi / 8), cos(pi / 8))
    robot.send(transform('hand', 'flange', 0.1, 0.2, 0.3, eighth), static=True)
    # The knuckle is rotated by half a turn.
    robot.send(transform('left_knuckle', 'hand', y=-0.01, rotation=(0.0, 0.0, 1.0, 0.0)))
    robot.send(transform('left_finger', 'left_knuckle', y=0.005))
    assert robot.send(transform('right_finger', 'hand', y=0.025)).gap == pytest.approx(0.015 + 0.025 - 0.012)


def test_transforms_that_stop_leave_no_opening_though_others_continue(robot):
    assert not isnan(robot.send(*fingers(0.02, 0.02)).gap)
    for _ in range(round(2 * LIMIT / PERIOD)):
        robot.step()
        robot.send(transform('hand', 'flange'))
        # The position of one finger alone gives only half of an opening.
        opening = robot.send(transform('right_finger', 'hand', y=0.02))
    assert isnan(opening.gap) and opening.age > LIMIT
    assert robot.send(transform('left_finger', 'hand', y=-0.01)).gap == pytest.approx(0.030 - 0.012)


def test_frames_that_no_joint_moves_give_no_opening(robot):
    for each in fingers(0.02, 0.02):
        robot.send(each, static=True)
    assert robot.current() is UNKNOWN_OPENING


def test_a_finger_on_the_wrong_side_gives_no_opening(robot):
    assert robot.send(*fingers(-0.05, -0.05)) is UNKNOWN_OPENING


def test_transforms_that_were_held_back_give_no_opening(robot):
    shift = 1.7e9 - robot.steady()
    opening = robot.until_known(lambda: robot.send(*fingers(0.02, 0.02, stamp=robot.steady() + shift)))
    assert opening.gap == pytest.approx(0.028)
    late = robot.steady() + shift
    robot.wait(1.0)
    for i in range(5):
        opening = robot.send(*fingers(0.02, 0.02, stamp=late + 0.01 * i))
        assert isnan(opening.gap) and opening.age > 0.8


@pytest.mark.parametrize('gap', [0.0, 0.0305, 0.08])
def test_the_frames_of_the_pads_in_a_urdf_give_the_opening(ros, tf_message, gap):
    """The example gripper is closed, so that its two skins touch.

    The frames of the example gripper are those that robot_state_publisher publishes.
    """
    pytest.importorskip('xacro', reason='xacro is not installed')
    from scipy.spatial.transform import Rotation
    from urdf_frames import expand, joints
    from urdf_frames import transform as place
    positions = {'left_finger_joint': gap / 4, 'right_finger_joint': 3 * gap / 4}
    made = {'fixed': [], 'prismatic': []}
    for joint in joints(expand('example_gripper.urdf.xacro')):
        there = place(joint, positions)
        rotation = Rotation.from_matrix(there[:3, :3]).as_quat()
        made[joint.kind].append(transform(joint.child, joint.parent, *there[:3, 3], rotation=rotation))
    robot = Robot(ros, tf_message, frame_id='gripper', gap_frames=['left_pad', 'right_pad'], gap_offset=0.0)
    robot.send(*made['fixed'], static=True)
    assert robot.send(*made['prismatic']).gap == pytest.approx(gap)


@pytest.mark.parametrize('wrong, reason', [
    (transform('left_finger', 'hand', y=nan), R.NOT_FINITE), (transform('left_finger', 'hand', x=inf), R.NOT_FINITE),
    (transform('left_finger', 'hand', rotation=(0.0, 0.0, 0.0, 0.0)), R.INCONSISTENT),
    (transform('left_finger', 'hand', rotation=(0.0, 0.0, 0.0, 0.9)), R.INCONSISTENT),
    (transform('left_finger', 'left_finger'), R.INCONSISTENT), (transform('', 'hand'), R.INCONSISTENT),
    (transform('left_finger', '/'), R.INCONSISTENT), (TransformStamped(), R.INCONSISTENT)])
def test_a_malformed_transform_is_dropped_and_counted(robot, wrong, reason):
    assert robot.send(*fingers(0.02, 0.03)).gap == pytest.approx(0.038)
    robot.send(wrong, transform('right_finger', 'hand', y=0.5))
    assert robot.source.subscriptions[0].counts.dropped == {reason: 1}
    assert isnan(robot.current().gap) or robot.current().gap == pytest.approx(0.038)


def test_made_up_frames_do_not_fill_the_memory(robot, monkeypatch):
    monkeypatch.setattr(opening_source, 'MOST_FRAMES', 100)
    for first in range(0, 200, 20):
        robot.send(*(transform(f'made_up_{first + i}', 'hand') for i in range(20)))
    assert robot.source.subscriptions[0].counts.dropped == {R.TOO_LARGE: 5}


def test_where_tf2_msgs_is_missing_the_error_names_it(ros, monkeypatch):
    monkeypatch.setitem(__import__('sys').modules, 'tf2_msgs', None)
    monkeypatch.setitem(__import__('sys').modules, 'tf2_msgs.msg', None)
    with pytest.raises(ConfigurationError, match='tf2_msgs'):
        OpeningBench(ros, ()).make(**PARAMETERS)
