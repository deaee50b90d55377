"""The simulated hand on ROS: target poses move the hand, and the frames agree with the parameters of the grasp node."""

from importlib.util import find_spec
from math import nan, pi
from pathlib import Path

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PoseStamped
from ros_bench import RosBench

from examples.simulated_gripper.drive import Command
from examples.simulated_gripper.hand_interface import HandInterface, frames, target_of
from examples.simulated_gripper.items import ITEMS
from examples.simulated_gripper.world import World
from tactile_node.errors import InputError
from tactile_node.grasp.gripper import Gripper, PadPose
from tactile_node.ros.opening_messages import quaternion, transform

PARAMETERS = Path(__file__).resolve().parents[1] / 'examples/simulated_gripper/parameters.yaml'
physics = pytest.mark.skipif(find_spec('mujoco') is None,
                             reason='MuJoCo is not installed: pip install -r requirements/bench_physics.txt')


def target(x=0.0, y=0.0, z=0.05, rpy=(0.0, 0.0, 0.0), frame='table'):
    made = PoseStamped()
    made.header.frame_id = frame
    at = made.pose.position
    at.x, at.y, at.z = x, y, z
    made.pose.orientation = quaternion(*rpy)
    return made


def test_a_target_is_the_pose_of_the_hand_above_the_table():
    found = target_of(target(0.01, -0.02, 0.15, rpy=(0.0, 0.0, 0.3)))
    assert found == pytest.approx({'x': 0.01, 'y': -0.02, 'lift': 0.1, 'yaw': 0.3})


@pytest.mark.parametrize('yaw', [3.0, -3.0])
def test_a_quaternion_and_its_negative_are_the_same_yaw(yaw):
    message = target(rpy=(0.0, 0.0, yaw))
    turn = message.pose.orientation
    turn.z, turn.w = -turn.z, -turn.w
    assert target_of(message)['yaw'] == pytest.approx(yaw)


@pytest.mark.parametrize('wrong', [
    target(frame='world'), target(x=nan), target(rpy=(0.1, 0.0, 0.0)), target(rpy=(pi, 0.0, 0.0)),
], ids=['frame', 'nan', 'tilted', 'upside_down'])
def test_an_impossible_target_is_refused(wrong):
    with pytest.raises(InputError, match='target pose'):
        target_of(wrong)


def test_a_quaternion_of_zeros_is_refused():
    message = target()
    message.pose.orientation.w = 0.0
    with pytest.raises(InputError, match='quaternion'):
        target_of(message)


@physics
def test_the_frames_are_those_of_the_parameters():
    given = yaml.safe_load(PARAMETERS.read_text(encoding='utf-8'))['/**/grasp']['ros__parameters']
    gripper = Gripper(*(PadPose(tuple(given[f'{side}_xyz']), tuple(given[f'{side}_rpy'])) for side in
                        ('left', 'right')))
    world = World(ITEMS['square'])
    world.move(x=0.01, y=0.02, lift=0.03, yaw=0.4)
    world.command(Command(0.06))
    world.step(2.0)
    hand, *pads = frames(world)
    assert (hand.parent, hand.name) == ('table', 'gripper')
    assert hand.pose.translation == pytest.approx([0.01, 0.02, 0.08], abs=1e-3)
    assert np.arctan2(*hand.pose.rotation[1::-1, 0]) == pytest.approx(0.4, abs=0.01)
    for pad, pose, side in zip(pads, (gripper.left, gripper.right), ('left', 'right')):
        assert (pad.parent, pad.name) == ('gripper', f'{side}_pad')
        assert pad.pose.rotation == pytest.approx(pose.rotation, abs=1e-6)
        assert pad.pose.translation == pytest.approx(pose.place((0.0, 0.0), world.gap), abs=1e-3)


@physics
@pytest.mark.ros
def test_a_target_on_the_topic_moves_the_hand_and_its_frame(ros, tf_message, monkeypatch):
    monkeypatch.setattr('examples.simulated_gripper.hand_interface.HAS_TF', True)
    world, heard, bench = World(ITEMS['square']), [], RosBench(ros)
    HandInterface(bench.add('simulated_gripper'), world)
    planner = bench.add('planner')
    planner.create_subscription(tf_message, '/tf', heard.append, 1)
    publisher = planner.create_publisher(PoseStamped, 'hand/target_pose', 1)
    bench.until(lambda: publisher.get_subscription_count() and heard)
    publisher.publish(target(z=0.07, rpy=(1.0, 0.0, 0.0)))  # refused
    publisher.publish(target(x=0.01, z=0.06))
    bench.until(lambda: world.is_moving)
    world.step(2.0)
    heard.clear()
    bench.until(lambda: len(heard) > 1)
    found = {each.child_frame_id: transform(each.transform) for each in heard[-1].transforms}
    assert set(found) == {'gripper', 'left_pad', 'right_pad'}
    assert found['gripper'].translation == pytest.approx([0.01, 0.0, 0.06], abs=1e-3)
