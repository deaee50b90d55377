"""The opening of the gripper from the frames of its fingers."""

import math
import time
from collections import defaultdict
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node

from tactile_node.grasp.frame_tree import FrameTree
from tactile_node.grasp.opening import NOT_KNOWN, GapSource, LinearGap, Opening, is_plausible, opening
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.ros.measurement_time import MeasurementTime, use_stamps
from tactile_node.ros.message_checks import RejectReason, check_transforms
from tactile_node.ros.opening_messages import frame_name, transform
from tactile_node.ros.qos import TF_QOS, TF_STATIC_QOS
from tactile_node.ros.settings import GraspNodeSettings
from tactile_node.ros.tf_message import tf_message_type
from tactile_node.ros.time_messages import seconds

MOST_FRAMES = 10_000  #: of the robot and of one message: made-up names must not fill the memory


class TfOpening:
    """The distance of two frames along the closing direction."""

    def __init__(self, node: Node, settings: GraspNodeSettings, law: LinearGap, closing: np.ndarray):
        self._law = law
        self._closing = closing
        self._reference = frame_name(settings.frame)
        self._left, self._right = map(frame_name, settings.fingers)
        self._max_age = settings.max_gap_age
        self._tree = FrameTree()
        self._measured: defaultdict[str, MeasurementTime] = defaultdict(
            partial(MeasurementTime, use_stamps=use_stamps(node, settings)))
        kind = tf_message_type('parameter gap_source tf')
        self.subscriptions = (GuardedSubscription(node, kind, '/tf', self._on_tf, TF_QOS, check=self._check),
                              GuardedSubscription(node, kind, '/tf_static', self._on_tf_static, TF_STATIC_QOS,
                                                  check=self._check))
        self.remedy = (f'no plausible distance of the moving frames {self._left} and {self._right} in '
                       f'{self._reference} from /tf')

    def current(self, now: float) -> Opening:
        left, right = (self._tree.find(frame, self._reference) for frame in (self._left, self._right))
        if left is None or right is None:
            return NOT_KNOWN
        measured = min(left.measured, right.measured)
        distance = float(self._closing @ (right.transform.translation - left.transform.translation))
        gap = self._law.gap(distance)
        if measured == math.inf or not is_plausible(gap):  # static: these frames do not move with the fingers
            return NOT_KNOWN
        return opening(gap, GapSource.TF, max(0.0, now - measured), self._max_age)

    def _check(self, message: Any) -> RejectReason | None:
        if len(self._tree) + len(message.transforms) > MOST_FRAMES:
            return RejectReason.TOO_LARGE
        return check_transforms(message.transforms)

    def _on_tf(self, message: Any) -> None:
        now = time.monotonic()
        for each in message.transforms:
            self._set(each, self._measured[frame_name(each.child_frame_id)].of(seconds(each.header.stamp), now))

    def _on_tf_static(self, message: Any) -> None:
        for each in message.transforms:
            self._set(each, math.inf)

    def _set(self, message: TransformStamped, measured: float) -> None:
        self._tree.set(frame_name(message.child_frame_id), frame_name(message.header.frame_id),
                       transform(message.transform), measured)
