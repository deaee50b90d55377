"""ROS interface of the simulated hand: a topic for target poses, and the frames of the hand and of both pads."""

from importlib.util import find_spec
from math import atan2, hypot
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import PoseStamped, TransformStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from scipy.spatial.transform import Rotation

from examples.simulated_gripper.items import PAD_HEIGHT
from examples.simulated_gripper.world import SIDES, World
from tactile_node.errors import InputError
from tactile_node.grasp.frame_tree import Transform

TABLE = 'table'   #: frame whose origin is on the table below the initial hand, with z up
HAND = 'gripper'  #: frame of the hand, with its origin midway between the pads; the grasp node's default frame_id
TARGET = 'hand/target_pose'
HAS_TF = find_spec('tf2_msgs') is not None  #: without tf2_msgs, the frames are not published
FRAME_PERIOD = 0.02  #: publishing period of the frames [s]
MAX_TILT = 0.01      #: largest x or y of the target's unit quaternion; about 1 degree of tilt


class Frame(NamedTuple):
    """A frame with its parent and its pose in the parent."""

    parent: str
    name: str
    pose: Transform


def frames(world: World) -> list[Frame]:
    """Return the frame of the hand in the frame of the table, and the frames of both pads in the frame of the hand."""
    with world.lock:
        poses = [Transform(each.xmat.reshape(3, 3).copy(), each.xpos.copy()) for each in (
            world.data.body('hand'), *(world.data.site(f'{side}_pad') for side in SIDES))]
    hand, *pads = poses
    return [Frame(TABLE, HAND, hand),
            *(Frame(HAND, f'{side}_pad', hand.inverse @ pad) for side, pad in zip(SIDES, pads))]


def target_of(message: PoseStamped) -> dict[str, float]:
    """Return the goals of the hand's axes for a target pose of the hand in the frame of the table. Raises InputError.

    The hand turns about its vertical axis only.
    """
    at, turn = message.pose.position, message.pose.orientation
    if message.header.frame_id != TABLE:
        raise InputError('target pose', expected=f'the frame {TABLE}', got=repr(message.header.frame_id),
                         remedy=f'Transform the pose to the frame {TABLE}.')
    numbers = (at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w)
    length = hypot(turn.x, turn.y, turn.z, turn.w)
    if not np.isfinite(numbers).all() or abs(length - 1) > MAX_TILT or max(abs(turn.x), abs(turn.y)) > MAX_TILT:
        raise InputError('target pose', expected='finite values and a unit quaternion that turns about z only',
                         got=f'{numbers}', remedy='Set x and y of the quaternion to 0; the hand cannot tilt.')
    yaw = 2 * atan2(turn.z, turn.w)
    return {'x': at.x, 'y': at.y, 'lift': at.z - PAD_HEIGHT, 'yaw': atan2(np.sin(yaw), np.cos(yaw))}


class HandInterface:
    """Moves the hand of ``world`` to the poses on TARGET, and publishes its frames on /tf.

    A new target replaces the previous target. The node logs a target that it refuses, and the hand keeps its goal.
    """

    def __init__(self, node: Node, world: World):
        self._node, self._world = node, world
        node.create_subscription(PoseStamped, TARGET, self._move, 1)
        if HAS_TF:
            from tf2_msgs.msg import TFMessage
            publisher = node.create_publisher(TFMessage, '/tf', 100)
            node.create_timer(FRAME_PERIOD, lambda: publisher.publish(TFMessage(transforms=self._transforms())),
                              clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _move(self, message: PoseStamped) -> None:
        try:
            self._world.move(**target_of(message))
        except InputError as error:
            self._node.get_logger().error(str(error))

    def _transforms(self) -> list[TransformStamped]:
        stamp = self._node.get_clock().now().to_msg()
        return [_message(frame, stamp) for frame in frames(self._world)]


def _message(frame: Frame, stamp) -> TransformStamped:
    made = TransformStamped(child_frame_id=frame.name)
    made.header.frame_id, made.header.stamp = frame.parent, stamp
    move, turn = made.transform.translation, made.transform.rotation
    move.x, move.y, move.z = map(float, frame.pose.translation)
    turn.x, turn.y, turn.z, turn.w = map(float, Rotation.from_matrix(frame.pose.rotation).as_quat())
    return made
