"""Read and check messages about the opening of a gripper, and report the opening as a diagnostic status."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from geometry_msgs.msg import Transform as TransformMessage

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.frame_tree import Transform
from tactile_node.grasp.gripper import PadPose, rotation_matrix
from tactile_node.grasp.opening import GapSource, LinearGap, Opening, is_plausible
from tactile_node.ros.message_health import MessageCounts, dropped_since, dropped_values, status_of
from tactile_node.skin.taxel_array import RejectReason, check_finite, check_time

if TYPE_CHECKING:
    # This import is for type checkers only, because it takes 40 ms and not every grasp node needs it.
    from sensor_msgs.msg import JointState

QUATERNION_TOLERANCE = 1e-2  #: allowed error of the length of a quaternion, as in tf2


def sum_of_positions(message: 'JointState', joints: Sequence[str]) -> float:
    """Return the sum of the positions of ``joints`` [m or rad]. The message must contain all ``joints``."""
    positions = dict(zip(message.name, message.position))
    return sum(positions[joint] for joint in joints)


def transform(message: TransformMessage) -> Transform:
    place, turn = message.translation, message.rotation
    return Transform(rotation_matrix(turn.x, turn.y, turn.z, turn.w), np.array((place.x, place.y, place.z)))


def pad_transform(pose: PadPose, gap: float, frame: str, parent: str, stamp: Time) -> TransformStamped:
    """Return the transform from the frame of the gripper to the frame of a pad.

    Parameters
    ----------
    pose
        Pose of the pad on the closed gripper.
    gap
        Opening of the gripper [m].
    frame
        Name of the pad's frame.
    parent
        Name of the gripper's frame.
    stamp
        Stamp of the transform.
    """
    made = TransformStamped(child_frame_id=frame)
    made.header.frame_id = parent
    made.header.stamp = stamp
    x, y, z = map(float, pose.place((0.0, 0.0), gap))
    made.transform = TransformMessage(translation=Vector3(x=x, y=y, z=z), rotation=quaternion(*pose.rpy))
    return made


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return a rotation by roll, pitch and yaw about fixed axes (REP-103) as a quaternion."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(np.array((roll, pitch, yaw)) / 2), np.sin(np.array((roll, pitch, yaw)) / 2)
    return Quaternion(x=float(sr * cp * cy - cr * sp * sy), y=float(cr * sp * cy + sr * cp * sy),
                      z=float(cr * cp * sy - sr * sp * cy), w=float(cr * cp * cy + sr * sp * sy))


def frame_name(name: str) -> str:
    """Return a frame name without the leading slash that some publishers still add, because names in tf2 have none."""
    return name.lstrip('/')


def tf_message_type(where: str) -> type:
    """Return the message type of /tf. Raises ConfigurationError about ``where`` if tf2_msgs is not installed."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError as error:
        raise ConfigurationError(
            where, expected='the ROS package tf2_msgs', got=f'{error}',
            remedy='Install ros-$ROS_DISTRO-tf2-msgs, or omit the option.') from None
    return TFMessage


def check_joint_state(message: 'JointState', joints: Sequence[str], law: LinearGap) -> RejectReason | None:
    """Check that the message has one position for each of ``joints``, and that the resulting opening is plausible."""
    if len(message.position) != len(message.name):
        return RejectReason.WRONG_LENGTH
    if not set(joints) <= set(message.name):
        return RejectReason.MISSING_JOINT
    if any(message.name.count(joint) > 1 for joint in joints):
        return RejectReason.INCONSISTENT
    total = sum_of_positions(message, joints)
    return (check_finite(total)
            or (None if is_plausible(law.gap(total)) else RejectReason.IMPLAUSIBLE_OPENING)
            or check_time(message.header.stamp))


def check_transforms(transforms: Sequence[TransformStamped]) -> RejectReason | None:
    """Check that each transform of a tf message relates two frames by a unit quaternion, as tf2 requires."""
    return next((reason for each in transforms if (reason := _transform(each))), None)


def _transform(message: TransformStamped) -> RejectReason | None:
    place, turn = message.transform.translation, message.transform.rotation
    parent, child = frame_name(message.header.frame_id), frame_name(message.child_frame_id)
    numbers = (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)
    if not all(map(math.isfinite, numbers)):
        return RejectReason.NOT_FINITE
    if not parent or not child or parent == child or abs(math.hypot(*numbers[3:]) - 1) > QUATERNION_TOLERANCE:
        return RejectReason.INCONSISTENT
    return check_time(message.header.stamp)


def why_not_known(opening: Opening, remedy: str) -> str:
    """Return the reason why ``opening`` has no known gap, as text.

    If the source has not yet provided an opening, the reason is ``remedy``, which names the missing data.
    """
    if opening.source is GapSource.NOT_KNOWN:
        return remedy
    if opening.age == math.inf:
        return ('its age is not known, because its stamps do not advance with time: check for a second publisher '
                'or a changed clock')
    return f'its last value is {opening.age:.1f} s old; {remedy}'


def opening_status(node: str, opening: Opening, counts: MessageCounts, before: MessageCounts,
                   remedy: str) -> DiagnosticStatus:
    """Return the diagnostic status of the opening.

    The level is STALE if the opening is not known. If it is known, the level is WARN if messages were dropped since the
    last status, otherwise OK.

    Parameters
    ----------
    node
        Full name of the node.
    opening
        Present opening.
    counts
        Current counts of the messages that the source has received.
    before
        Counts of the same messages at the last status.
    remedy
        Text that names the missing data.
    """
    dropped = dropped_since(counts, before)
    is_known = not math.isnan(opening.gap)
    texts = [f'{1e3 * opening.gap:.1f} mm' if is_known else f'not known: {why_not_known(opening, remedy)}',
             *([f'messages dropped: {dropped}'] if dropped else [])]
    level = DiagnosticStatus.STALE if not is_known else DiagnosticStatus.WARN if dropped else DiagnosticStatus.OK
    values = {'gap_m': f'{opening.gap:.4f}', 'source': opening.source.name.lower(),
              'age_s': f'{opening.age:.3f}' if opening.age < math.inf else 'not known',
              **dropped_values(counts)}
    return status_of(f'{node}: opening', level, '; '.join(texts), values)
