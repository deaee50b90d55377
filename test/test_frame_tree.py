"""Frames in frames: placements by hand, and the age of a chain."""

from math import cos, inf, pi, sin

import numpy as np
import pytest

from tactile_node.grasp.frame_tree import FrameTree, Transform, rotation_matrix

QUARTER = (0.0, 0.0, sin(pi / 4), cos(pi / 4))  # quaternion of a quarter turn about z: x to y, y to -x
STRAIGHT = (0.0, 0.0, 0.0, 1.0)


def at(x, y, z, quaternion=STRAIGHT):
    return Transform(rotation_matrix(*quaternion), np.array((x, y, z), float))


def gripper(left=0.02, right=0.02, measured=100.0):
    """A hand turned by a quarter at the end of an arm; its fingers slide along its y."""
    tree = FrameTree()
    tree.set('flange', 'base', at(1, 2, 3), 7.0)
    tree.set('hand', 'flange', at(0, 0, 0.1, QUARTER))
    tree.set('left', 'hand', at(0, -left, 0.05), measured)
    tree.set('right', 'hand', at(0, right, 0.05), measured)
    return tree


def test_a_quaternion_rotates_as_in_rep_103():
    assert rotation_matrix(*QUARTER) @ (1, 0, 0) == pytest.approx([0, 1, 0])
    assert rotation_matrix(1, 0, 0, 0) @ (0, 1, 2) == pytest.approx([0, -1, -2])
    assert rotation_matrix(0, 2, 0, 2) @ (0, 0, 1) == pytest.approx([1, 0, 0])  # a quarter about y; length 2.8


def test_up_down_and_across_the_tree():
    tree = gripper()
    assert tree.find('left', 'hand').transform.translation == pytest.approx([0, -0.02, 0.05])
    assert tree.find('hand', 'left').transform.translation == pytest.approx([0, 0.02, -0.05])
    assert tree.find('right', 'left').transform.translation == pytest.approx([0, 0.04, 0])
    assert tree.find('left', 'base').transform.translation == pytest.approx([1.02, 2, 3.15])  # -y of the hand is x
    assert tree.find('base', 'hand').transform.translation == pytest.approx([-2, 1, -3.1])
    assert tree.find('hand', 'hand').transform.translation == pytest.approx([0, 0, 0])


def test_a_chain_is_as_old_as_its_oldest_moving_transform():
    tree = gripper(measured=100.0)
    tree.set('right', 'hand', at(0, 0.03, 0), 101.0)
    assert tree.find('right', 'hand').measured == 101.0
    assert tree.find('right', 'left').measured == 100.0
    assert tree.find('right', 'base').measured == 7.0
    assert tree.find('hand', 'flange').measured == inf


def test_frames_that_nothing_joins_are_nowhere():
    tree = gripper()
    assert tree.find('left', 'tool') is None and tree.find('tool', 'left') is None
    assert FrameTree().find('left', 'right') is None


def test_a_frame_may_get_another_parent():
    tree = gripper()
    tree.set('left', 'base', at(5, 0, 0), 8.0)
    assert tree.find('left', 'base').transform.translation == pytest.approx([5, 0, 0])


def test_frames_in_a_circle_are_nowhere():
    tree = gripper()
    for frame, parent in (('a', 'b'), ('b', 'c'), ('c', 'a'), ('d', 'a')):
        tree.set(frame, parent, at(1, 0, 0), 1.0)
    assert tree.find('a', 'b') is None and tree.find('d', 'c') is None and tree.find('left', 'a') is None
    assert tree.find('left', 'hand') is not None
