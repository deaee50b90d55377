"""The opening of a gripper from joint states or frames: commercial grippers, signs, units, and frame trees."""

from math import atan2, cos, inf, isnan, nan, pi, sin, sqrt

import numpy as np
import pytest

from tactile_node.grasp.frame_tree import FrameTree, Transform
from tactile_node.grasp.gripper import Gripper, PadPose, contact_line, rotation_matrix
from tactile_node.grasp.opening import is_plausible

# When the gripper is closed, the skins of two 16x16 pads with 2 mm pitch touch. The left pad faces along z. The right
# pad is rotated by pi about x and faces along -z, so its y axis points opposite to the gripper's.
PADS = Gripper(PadPose((-0.015, -0.015, 0.0), (0.0, 0.0, 0.0)), PadPose((-0.015, 0.015, 0.0), (pi, 0.0, 0.0)))


def test_a_box_of_40_mm_held_in_the_middle():
    line = contact_line(PADS, (0.015, 0.015), (0.015, 0.015), 0.040)
    assert line.left == pytest.approx([0, 0, -0.020])
    assert line.right == pytest.approx([0, 0, 0.020])
    assert line.midpoint == pytest.approx([0, 0, 0])
    assert line.axis == pytest.approx([0, 0, 1])
    assert (line.width, line.offset, line.misalignment) == pytest.approx((0.040, 0, 0))


def test_a_wedge_touched_3_mm_higher_on_the_right():
    # The y axis of the right pad points down, so y = 12 mm is 3 mm higher than y = 15 mm.
    line = contact_line(PADS, (0.015, 0.015), (0.015, 0.012), 0.004)
    assert line.right - line.left == pytest.approx([0, 0.003, 0.004])
    assert line.width == pytest.approx(0.005)
    assert line.offset == pytest.approx(0.003)
    assert line.misalignment == pytest.approx(atan2(3, 4))


def test_without_an_opening_all_that_depends_on_it_is_nan_and_the_offset_is_not():
    line = contact_line(PADS, (0.015, 0.015), (0.019, 0.012), nan)
    assert line.offset == pytest.approx(sqrt(3**2 + 4**2) * 1e-3)
    assert isnan(line.width) and isnan(line.misalignment)
    for vector in (line.left, line.right, line.midpoint, line.axis):
        assert np.isnan(vector).all()


@pytest.mark.parametrize('gap, plausible', [
    (0.0, True), (0.085, True), (-0.002, True), (-0.04, False), (40.0, False), (nan, False), (float('inf'), False)])
def test_a_wrong_sign_or_unit_of_the_scale_shows(gap, plausible):
    assert is_plausible(gap) is plausible


# Quaternion for a quarter turn about z, which turns x into y and y into -x.
QUARTER = (0.0, 0.0, sin(pi / 4), cos(pi / 4))
STRAIGHT = (0.0, 0.0, 0.0, 1.0)


def at(x, y, z, quaternion=STRAIGHT):
    return Transform(rotation_matrix(*quaternion), np.array((x, y, z), float))


def gripper(left=0.02, right=0.02, measured=100.0):
    """Return a frame tree in which the hand at the end of an arm is rotated by a quarter turn.

    The fingers of the hand slide along its y axis.
    """
    tree = FrameTree()
    tree.set('flange', 'base', at(1, 2, 3), 7.0)
    tree.set('hand', 'flange', at(0, 0, 0.1, QUARTER))
    tree.set('left', 'hand', at(0, -left, 0.05), measured)
    tree.set('right', 'hand', at(0, right, 0.05), measured)
    return tree


def test_a_quaternion_rotates_as_in_rep_103():
    assert rotation_matrix(*QUARTER) @ (1, 0, 0) == pytest.approx([0, 1, 0])
    assert rotation_matrix(1, 0, 0, 0) @ (0, 1, 2) == pytest.approx([0, -1, -2])
    # A quarter turn about y, as a quaternion of length 2.8.
    assert rotation_matrix(0, 2, 0, 2) @ (0, 0, 1) == pytest.approx([1, 0, 0])


def test_up_down_and_across_the_tree():
    tree = gripper()
    assert tree.find('left', 'hand').transform.translation == pytest.approx([0, -0.02, 0.05])
    assert tree.find('hand', 'left').transform.translation == pytest.approx([0, 0.02, -0.05])
    assert tree.find('right', 'left').transform.translation == pytest.approx([0, 0.04, 0])
    # The hand's -y axis points along the x axis of the base.
    assert tree.find('left', 'base').transform.translation == pytest.approx([1.02, 2, 3.15])
    assert tree.find('base', 'hand').transform.translation == pytest.approx([-2, 1, -3.1])
    assert tree.find('hand', 'hand').transform.translation == pytest.approx([0, 0, 0])


def test_a_chain_is_as_old_as_its_oldest_moving_transform():
    tree = gripper(measured=100.0)
    tree.set('right', 'hand', at(0, 0.03, 0), 101.0)
    assert tree.find('right', 'hand').measured == 101.0
    assert tree.find('right', 'left').measured == 100.0
    assert tree.find('right', 'base').measured == 7.0
    assert tree.find('hand', 'flange').measured == inf


def test_unconnected_frames_have_no_pose():
    tree = gripper()
    assert tree.find('left', 'tool') is None and tree.find('tool', 'left') is None
    assert FrameTree().find('left', 'right') is None


def test_frames_that_form_a_loop_have_no_pose():
    tree = gripper()
    for frame, parent in (('a', 'b'), ('b', 'c'), ('c', 'a'), ('d', 'a')):
        tree.set(frame, parent, at(1, 0, 0), 1.0)
    assert tree.find('a', 'b') is None and tree.find('d', 'c') is None and tree.find('left', 'a') is None
    assert tree.find('left', 'hand') is not None
