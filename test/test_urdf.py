"""The pad frames of the gripper macro equal values computed by hand, and the grasp node must agree with these
frames."""

from math import pi

import numpy as np
import pytest
from urdf_frames import URDF, expand, joints, place

from tactile_node.grasp.gripper import Gripper, PadPose, contact_line

GRIPPER = 'example_gripper.urdf.xacro'


@pytest.fixture(scope='module')
def robot():
    return expand(GRIPPER)


def opened(by):
    return {'left_finger_joint': by / 2, 'right_finger_joint': by / 2}


@pytest.mark.parametrize('gap', [0.0, 0.04])
def test_the_pads_are_where_the_drawing_has_them(robot, gap):
    """The centres of the skins lie 130 mm from the gripper's origin along z.

    Taxel (0, 0) is 15 mm from the centre along rows and columns, which is half of 15 pitches of 2 mm.
    """
    left, right = (place(robot, f'{side}_pad', opened(gap)) for side in ('left', 'right'))
    assert left[:3, 3] == pytest.approx([-0.015, -gap / 2, 0.145])
    assert right[:3, 3] == pytest.approx([-0.015, gap / 2, 0.115])
    # The z axis of the left pad points towards the right pad.
    assert left[:3, :3] == pytest.approx(np.array([(1, 0, 0), (0, 0, 1), (0, -1, 0)]))
    assert right[:3, :3] == pytest.approx(np.array([(1, 0, 0), (0, 0, -1), (0, 1, 0)]))
    for side in ('left', 'right'):
        skin = place(robot, f'{side}_skin', opened(gap))
        assert skin[:3, 3] == pytest.approx([0, {'left': -1, 'right': 1}[side] * gap / 2, 0.130])


def test_a_grasp_has_the_places_of_the_urdf(robot):
    """The parameters left_xyz to right_rpy describe the closed gripper.

    With these parameters, the grasp node must place contacts where the moved URDF frames place them.
    """
    node = Gripper(PadPose((-0.015, 0.0, 0.145), (-pi / 2, 0.0, 0.0)),
                   PadPose((-0.015, 0.0, 0.115), (pi / 2, 0.0, 0.0)))
    for gap in (0.0, 0.013, 0.08):
        line = contact_line(node, (0.012, 0.004), (0.017, 0.021), gap)
        left = place(robot, 'left_pad', opened(gap)) @ (0.012, 0.004, 0.0, 1.0)
        right = place(robot, 'right_pad', opened(gap)) @ (0.017, 0.021, 0.0, 1.0)
        assert line.left == pytest.approx(left[:3]) and line.right == pytest.approx(right[:3])
        assert line.width == pytest.approx(np.linalg.norm((right - left)[:3]))


def test_pads_of_two_grippers_have_names_of_their_own(tmp_path):
    include = f'<xacro:include filename="{URDF}/tactile_pads.urdf.xacro"/>'
    pads = ''.join(
        f'<xacro:tactile_pads prefix="{hand}_" left_parent="base" right_parent="base" rows="12" cols="5" pitch="0.003">'
        '<origin xyz="0 0 0"/><origin xyz="0 0 0.1" rpy="${pi} 0 0"/></xacro:tactile_pads>' for hand in ('a', 'b'))
    path = tmp_path / 'two.urdf.xacro'
    path.write_text(f'<robot name="two" xmlns:xacro="http://www.ros.org/wiki/xacro">{include}<link name="base"/>{pads}'
                    '</robot>', encoding='utf-8')
    robot = expand(path)
    children = [joint.child for joint in joints(robot)]
    assert sorted(name for name in children if name.endswith('_pad')) == [
        'a_left_pad', 'a_right_pad', 'b_left_pad', 'b_right_pad']
    assert place(robot, 'b_left_pad', {})[:3, 3] == pytest.approx([-0.006, -0.0165, 0])
    assert place(robot, 'b_right_pad', {})[:3, 3] == pytest.approx([-0.006, 0.0165, 0.1])
