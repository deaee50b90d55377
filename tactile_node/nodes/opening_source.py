"""Sources of the gripper's opening: a parameter, the joint states or tf."""

import logging
import math
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data

from tactile_node.bus.log_throttle import LogThrottle
from tactile_node.errors import ConfigurationError
from tactile_node.grasp.frame_tree import FrameTree
from tactile_node.grasp.opening import UNKNOWN_OPENING, GapSource, LinearGap, Opening, is_plausible, opening
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.node_health import publish_status
from tactile_node.parameter import table
from tactile_node.ros.message_age import MeasurementTime, use_stamps
from tactile_node.ros.message_health import total
from tactile_node.ros.opening_messages import (
    check_joint_state,
    check_transforms,
    frame_name,
    opening_status,
    sum_of_positions,
    tf_message_type,
    transform,
    why_not_known,
)
from tactile_node.ros.qos import TF_QOS, TF_STATIC_QOS
from tactile_node.ros.rosout_handler import of_node
from tactile_node.ros.settings import GraspNodeSettings
from tactile_node.ros.time_messages import seconds
from tactile_node.skin.taxel_array import RejectReason

if TYPE_CHECKING:
    from sensor_msgs.msg import JointState

logger = logging.getLogger(__name__)

#: Allowed values of the parameter gap_source.
GAP_SOURCES = PARAMETER, JOINT_STATES, TF, NONE = 'parameter', 'joint_states', 'tf', 'none'
#: parameter -> the sources that read it
READ_BY = {'gap': (PARAMETER,), 'gap_joints': (JOINT_STATES,), 'gap_frames': (TF,), 'gap_scale': (JOINT_STATES, TF),
           'gap_offset': (JOINT_STATES, TF)}
#: Maximum number of frames in the tree, including those of a new message. Bogus frame names could otherwise fill the
#: memory.
MOST_FRAMES = 10_000


class OpeningSource(Protocol):
    """Source of the gripper's opening. The method ``current`` never raises an exception and never blocks."""

    def current(self) -> Opening:
        """Return the current opening."""


class ParameterOpening:
    """Opening from the live parameter ``gap``.

    A value stays valid until the next one is set. A negative value means that the opening is not known.
    """

    def __init__(self, node: Node, steady: Callable[[], float]):
        self._steady = steady
        self._on_parameters([node.get_parameter('gap')])
        node.add_post_set_parameters_callback(self._on_parameters)

    def current(self) -> Opening:
        """Return the current opening."""
        gap, set_at = self._latest
        return opening(gap, GapSource.PARAMETER, self._steady() - set_at)

    def _on_parameters(self, parameters: Sequence[Parameter]) -> None:
        for each in parameters:
            if each.name == 'gap':
                # the gap [m], and the time when it was set, on the steady clock [s]
                self._latest = each.value if each.value >= 0 else math.nan, self._steady()


def refuse_a_gap_that_nothing_reads(node: Node, source: str) -> None:
    """Refuse changes to the parameter ``gap`` at run time if the selected ``source`` does not read that parameter."""
    def check(parameters: Sequence[Parameter]) -> SetParametersResult:
        is_set = any(each.name == 'gap' and each.value >= 0 for each in parameters)
        refused = is_set and source != PARAMETER
        return SetParametersResult(successful=not refused,
                                   reason=f'the opening comes from gap_source {source}' if refused else '')
    node.add_on_set_parameters_callback(check)


class MeasuredOpening:
    """Base class of opening sources that read messages.

    The source publishes its state on /diagnostics once a second. While the opening is not known, the source logs a
    warning at increasing intervals. If the opening becomes known after a warning, the source logs that once.

    Parameters
    ----------
    node : Node
        Node that subscribes.
    subscriptions : sequence of GuardedSubscription
        Subscriptions of the source.
    remedy : str
        Text that tells the user what to check while the opening is not known.
    steady : callable
        Steady clock [s].
    """

    def __init__(self, node: Node, subscriptions: Sequence[GuardedSubscription], remedy: str,
                 steady: Callable[[], float]):
        self._node, self._remedy, self._steady = node, remedy, steady
        self.subscriptions = subscriptions
        self._throttle = LogThrottle()
        self._before = total(())
        publish_status(node, self._status)

    def current(self) -> Opening:
        """Return the current opening."""
        raise NotImplementedError

    def _status(self) -> DiagnosticStatus:
        current, name = self.current(), self._node.get_fully_qualified_name()
        if not math.isnan(current.gap):
            if self._throttle.reset():
                logger.info('the opening of the gripper is known: %.1f mm', 1e3 * current.gap,
                            extra=of_node(self._node))
        elif self._throttle.is_due('unknown', self._steady()):
            logger.warning('the opening of the gripper is not known: %s', why_not_known(current, self._remedy),
                           extra=of_node(self._node))
        before, self._before = self._before, total(subscription.counts for subscription in self.subscriptions)
        return opening_status(name, current, self._before, before, self._remedy)


class JointStatesOpening(MeasuredOpening):
    """Opening computed from the sum of joint positions.

    While the opening is known, messages that concern only other joints are ignored, because many nodes may share the
    topic.
    """

    def __init__(self, node: Node, settings: GraspNodeSettings, law: LinearGap, steady: Callable[[], float]):
        # A late import, because it takes 40 ms and other sources do not need it.
        from sensor_msgs.msg import JointState
        self._joints = settings.gap_joints
        self._law = law
        self._max_age = settings.max_gap_age
        # the latest gap [m], and the time when it was measured, on the steady clock [s]
        self._latest = math.nan, math.nan
        self._measured = MeasurementTime(use_stamps=use_stamps(node, settings))
        states = GuardedSubscription(node, JointState, settings.joint_states_topic, self._on_state,
                                     qos_profile_sensor_data, check=self._check, steady=steady)
        remedy = f'no usable joint states of {", ".join(self._joints)} on {states.topic}'
        super().__init__(node, [states], remedy, steady)

    def current(self) -> Opening:
        gap, measured = self._latest
        return opening(gap, GapSource.JOINT_STATES, self._steady() - measured, self._max_age)

    def _check(self, message: 'JointState') -> RejectReason | None:
        if self._is_of_others(message) and not math.isnan(self.current().gap):
            return None
        return check_joint_state(message, self._joints, self._law)

    def _on_state(self, message: 'JointState') -> None:
        if not self._is_of_others(message):
            measured = self._measured.of(seconds(message.header.stamp), self._steady())
            self._latest = self._law.gap(sum_of_positions(message, self._joints)), measured

    def _is_of_others(self, message: 'JointState') -> bool:
        return set(self._joints).isdisjoint(message.name)


class TfOpening(MeasuredOpening):
    """Opening computed from the distance between two tf frames along the closing direction."""

    def __init__(self, node: Node, settings: GraspNodeSettings, law: LinearGap, closing: np.ndarray,
                 steady: Callable[[], float]):
        self._law = law
        self._closing = closing
        self._reference = frame_name(settings.frame)
        self._left, self._right = map(frame_name, settings.fingers)
        self._max_age = settings.max_gap_age
        self._tree = FrameTree()
        self._measured: defaultdict[str, MeasurementTime] = defaultdict(
            partial(MeasurementTime, use_stamps=use_stamps(node, settings)))
        kind = tf_message_type('parameter gap_source tf')
        super().__init__(node, [GuardedSubscription(node, kind, topic, take, qos, check=self._check, steady=steady)
                                for topic, take, qos in (('/tf', self._on_tf, TF_QOS),
                                                         ('/tf_static', self._on_tf_static, TF_STATIC_QOS))],
                         f'no plausible distance of the moving frames {self._left} and {self._right} in '
                         f'{self._reference} from /tf', steady)

    def current(self) -> Opening:
        left, right = (self._tree.find(frame, self._reference) for frame in (self._left, self._right))
        if left is None or right is None:
            return UNKNOWN_OPENING
        measured = min(left.measured, right.measured)
        distance = float(self._closing @ (right.transform.translation - left.transform.translation))
        gap = self._law.gap(distance)
        if measured == math.inf or not is_plausible(gap):  # inf means static frames, which do not move with the fingers
            return UNKNOWN_OPENING
        return opening(gap, GapSource.TF, self._steady() - measured, self._max_age)

    def _check(self, message: Any) -> RejectReason | None:
        if len(self._tree) + len(message.transforms) > MOST_FRAMES:
            return RejectReason.TOO_LARGE
        return check_transforms(message.transforms)

    def _on_tf(self, message: Any) -> None:
        now = self._steady()
        for each in message.transforms:
            self._set(each, self._measured[frame_name(each.child_frame_id)].of(seconds(each.header.stamp), now))

    def _on_tf_static(self, message: Any) -> None:
        for each in message.transforms:
            self._set(each, math.inf)

    def _set(self, message: TransformStamped, measured: float) -> None:
        self._tree.set(frame_name(message.child_frame_id), frame_name(message.header.frame_id),
                       transform(message.transform), measured)


def make_opening_source(node: Node, settings: GraspNodeSettings, closing: np.ndarray,
                        steady: Callable[[], float] = time.monotonic) -> OpeningSource:
    """Return the source selected by the parameter gap_source.

    Parameters
    ----------
    node : Node
        Node that subscribes to the topics of the source.
    settings : GraspNodeSettings
        Settings of the node.
    closing : np.ndarray
        Unit vector from the left pad to the right pad, in the frame ``frame_id``.
    steady : callable
        Steady clock [s].

    Raises
    ------
    ConfigurationError
        Raised if a parameter is not compatible with the source.
    """
    _check(settings)
    refuse_a_gap_that_nothing_reads(node, settings.gap_source)
    law = LinearGap(settings.gap_offset, settings.gap_scale)
    if settings.gap_source == JOINT_STATES:
        return JointStatesOpening(node, settings, law, steady)
    if settings.gap_source == TF:
        return TfOpening(node, settings, law, closing, steady)
    source = ParameterOpening(node, steady)
    if math.isnan(source.current().gap):
        node.get_logger().info('the opening of the gripper is not known, so widths and positions in a grasp are NaN. '
                               'Set gap, or set gap_source to joint_states or tf')
    return source


def _check(settings: GraspNodeSettings) -> None:
    source, joints, frames = settings.gap_source, settings.gap_joints, settings.gap_frames
    if source not in GAP_SOURCES:
        raise ConfigurationError('parameter gap_source', expected=', '.join(GAP_SOURCES), got=repr(source),
                                 remedy='Name the source of the gripper opening.')
    for row in table(GraspNodeSettings):
        value, readers = getattr(settings, row.name), READ_BY.get(row.name, (source,))
        is_set = value >= 0 if row.name == 'gap' else value != row.default
        if is_set and source not in readers:
            raise ConfigurationError(f'parameter {row.name}', expected=f'no value with gap_source {source}',
                                     got=str(value), remedy=f'Remove it, or set gap_source to {" or ".join(readers)}.')
    if source == JOINT_STATES and (not all(joints) or not joints or len(set(joints)) < len(joints)):
        raise ConfigurationError('parameter gap_joints', expected='joint names that all differ', got=f'{list(joints)}',
                                 remedy='Take the names from the URDF. Omit a mimic joint, and double gap_scale.')
    if source == TF and (len(frames) != 2 or not all(frames) or len(set(map(frame_name, frames))) < 2):
        raise ConfigurationError('parameter gap_frames', expected='one frame on the left finger and one on the right',
                                 got=f'{list(frames)}', remedy='Take both names from the URDF.')
