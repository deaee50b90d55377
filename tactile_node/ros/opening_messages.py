"""From joint states and transforms, as messages, to what the opening of a gripper is computed from."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from geometry_msgs.msg import Transform as TransformMessage

from tactile_node.grasp.frame_tree import Transform, rotation_matrix
from tactile_node.grasp.gripper import PadPose

if TYPE_CHECKING:
    from sensor_msgs.msg import JointState


def sum_of_positions(message: 'JointState', joints: Sequence[str]) -> float:
    """Return the sum of the positions of ``joints``, which the message has [m or rad]."""
    positions = dict(zip(message.name, message.position))
    return sum(positions[joint] for joint in joints)


def transform(message: TransformMessage) -> Transform:
    place, turn = message.translation, message.rotation
    return Transform(rotation_matrix(turn.x, turn.y, turn.z, turn.w), np.array((place.x, place.y, place.z)))


def pad_transform(pose: PadPose, gap: float, frame: str, parent: str, stamp: Time) -> TransformStamped:
    """Return where the pad of a gripper that is open by ``gap`` [m] is in the frame ``parent`` of the gripper."""
    made = TransformStamped(child_frame_id=frame)
    made.header.frame_id = parent
    made.header.stamp = stamp
    x, y, z = map(float, pose.place((0.0, 0.0), gap))
    made.transform = TransformMessage(translation=Vector3(x=x, y=y, z=z), rotation=quaternion(*pose.rpy))
    return made


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the rotation by roll, pitch and yaw about fixed axes (REP-103)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(np.array((roll, pitch, yaw)) / 2), np.sin(np.array((roll, pitch, yaw)) / 2)
    return Quaternion(x=float(sr * cp * cy - cr * sp * sy), y=float(cr * sp * cy + sr * cp * sy),
                      z=float(cr * cp * sy - sr * sp * cy), w=float(cr * cp * cy + sr * sp * sy))


def frame_name(name: str) -> str:
    """Return the name as tf2 has it; some publishers still lead it with a slash."""
    return name.lstrip('/')
