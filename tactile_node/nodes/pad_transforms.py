"""Publish the coordinate frames of the two pads on tf, for a robot whose URDF does not define them."""

import logging
import math
import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.time import Duration

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.gripper import Gripper
from tactile_node.nodes.opening_source import NONE, PARAMETER, OpeningSource
from tactile_node.nodes.ticker import Ticker
from tactile_node.ros.opening_messages import frame_name, pad_transform, tf_message_type
from tactile_node.ros.qos import TF_QOS, TF_STATIC_QOS
from tactile_node.ros.rosout_handler import of_node
from tactile_node.ros.settings import GraspNodeSettings

logger = logging.getLogger(__name__)

TRANSFORM_PERIOD = 0.05  #: Time between two transforms on /tf [s], as in robot_state_publisher.
#: Two openings whose times differ by less than this limit come from the same measurement [s].
SAME_MEASUREMENT = 1e-4


class PadTransforms:
    """Publishes the transforms from the gripper's frame to both pads while the opening of the gripper is known.

    If the opening is a parameter, the transforms are static. If the opening is measured, the transforms are published
    on /tf with the time of the measurement. If the opening is not known, no transform is published, because a guess
    could be wrong.

    Parameters
    ----------
    node : Node
        Node that publishes.
    settings : GraspNodeSettings
        Settings of the node.
    gripper : Gripper
        Poses of the pads.
    source : OpeningSource
        Source of the opening.
    steady : callable
        Steady clock of the source [s].
    """

    def __init__(self, node: Node, settings: GraspNodeSettings, gripper: Gripper, source: OpeningSource,
                 steady: Callable[[], float] = time.monotonic):
        self._node = node
        self._steady = steady
        self._message = tf_message_type('parameter publish_pad_frames')
        self._frame = frame_name(settings.frame)
        self._pads = tuple(zip(map(frame_name, settings.frames_of_pads), (gripper.left, gripper.right)))
        self._source = source
        self._gap = math.nan  # opening in the last published transforms [m]
        self._measured = -math.inf  # latest possible time of the measurement in the last published transforms [s]
        is_static = settings.gap_source == PARAMETER
        self._publisher = node.create_publisher(self._message, '/tf_static' if is_static else '/tf',
                                                TF_STATIC_QOS if is_static else TF_QOS)
        if is_static:
            self._publish_static()
        Ticker(node, TRANSFORM_PERIOD, self._publish_static if is_static else self._publish_moving, on_executor=True)

    def _publish_static(self) -> None:
        gap = self._source.current().gap
        if not math.isnan(gap) and gap != self._gap:
            self._publish(gap, 0.0)

    def _publish_moving(self) -> None:
        # The thread may pause while it reads the opening. Compare the earliest possible time of this measurement with
        # the latest possible time of the last one, so that no measurement is published twice.
        before = self._steady()
        opening = self._source.current()
        if not math.isnan(opening.gap) and before - opening.age > self._measured + SAME_MEASUREMENT:
            self._measured = self._steady() - opening.age
            self._publish(opening.gap, opening.age)

    def _publish(self, gap: float, age: float) -> None:
        stamp = self._node.get_clock().now()
        past = Duration(nanoseconds=min(round(1e9 * age), stamp.nanoseconds))
        self._publisher.publish(self._message(transforms=[
            pad_transform(pose, gap, frame, self._frame, (stamp - past).to_msg()) for frame, pose in self._pads]))
        self._gap = gap


def publish_pad_frames(node: Node, settings: GraspNodeSettings, gripper: Gripper, source: OpeningSource,
                       steady: Callable[[], float] = time.monotonic) -> None:
    """Start `PadTransforms` if the parameter publish_pad_frames is true.

    The arguments are those of `PadTransforms`. If tf2_msgs is not installed, the node logs a warning instead. If the
    parameters do not allow the frames to be published, the function raises ConfigurationError.
    """
    if not settings.publish_pad_frames:
        return
    if len(settings.pad_frames) != 2:
        raise ConfigurationError('parameter pad_frames', expected='one frame for the left pad and one for the right',
                                 got=f'{list(settings.pad_frames)}',
                                 remedy="Name both frames. An empty name '' selects <name>_pad.")
    frames = {frame_name(name) for name in (*settings.frames_of_pads, settings.frame)}
    if len(frames) < 3 or frames & set(settings.fingers) - {settings.frame}:
        raise ConfigurationError(
            'parameter publish_pad_frames', expected='two pad_frames other than frame_id and gap_frames',
            got=', '.join(settings.frames_of_pads),
            remedy='If a URDF defines the frames of the pads, set publish_pad_frames to false.')
    if settings.gap_source == NONE:
        raise ConfigurationError('parameter publish_pad_frames', expected='a source of the opening', got=NONE,
                                 remedy='Set gap_source, because the poses of the pads depend on the opening.')
    try:
        PadTransforms(node, settings, gripper, source, steady)
    except ConfigurationError as error:
        logger.warning('the frames of the pads are not published: %s', error, extra=of_node(node))
