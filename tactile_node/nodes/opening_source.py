"""Where the opening of the gripper comes from: a parameter, the joint states or tf."""

import logging
import math
import time
from collections import Counter
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.opening import GapSource, LinearGap, Opening
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.health_timer import start_health_timer
from tactile_node.nodes.parameter_opening import ParameterOpening, refuse_a_gap_that_nothing_reads
from tactile_node.ros.message_checks import RejectReason
from tactile_node.ros.opening_health import opening_status, total, why_not_known
from tactile_node.ros.opening_messages import frame_name
from tactile_node.ros.settings import GraspNodeSettings
from tactile_node.threads.reminder import Reminder

logger = logging.getLogger(__name__)

NONE = 'none'  #: value of the parameter gap_source
NAMES = {source.name.lower(): source for source in GapSource if source}


class OpeningSource(Protocol):
    """Gives the opening of the gripper; it never raises and never waits."""

    def current(self, now: float) -> Opening:
        """Return the opening at ``now`` of the steady clock (time.monotonic) [s]."""


def make_opening_source(node: Node, settings: GraspNodeSettings, closing: np.ndarray) -> OpeningSource:
    """Return the source that the parameter gap_source names.

    ``closing``: unit vector from the left pad to the right one in the frame ``frame_id``. Raises ConfigurationError
    for a parameter that does not fit the source.
    """
    _check(settings)
    refuse_a_gap_that_nothing_reads(node, settings.gap_source)
    law = LinearGap(settings.gap_offset, settings.gap_scale)
    if settings.gap_source == 'joint_states':
        from tactile_node.nodes.joint_states_opening import JointStatesOpening
        return _Reporting(node, JointStatesOpening(node, settings, law))
    if settings.gap_source == 'tf':
        from tactile_node.nodes.tf_opening import TfOpening
        return _Reporting(node, TfOpening(node, settings, law, closing))
    source = ParameterOpening(node)
    if math.isnan(source.current(time.monotonic()).gap):
        logger.info('%s: the opening of the gripper is not known: widths and places in a grasp are NaN. Set gap, or '
                    'gap_source to joint_states or tf', node.get_fully_qualified_name())
    return source


class MeasuredSource(OpeningSource, Protocol):
    """A source that listens to messages."""

    remedy: str  #: what to look for while the opening is not known

    @property
    def subscriptions(self) -> Sequence[GuardedSubscription]:
        """What it listens to."""


class _Reporting:
    """A measured source; once a second its state goes to /diagnostics, and that it is not known to the log."""

    def __init__(self, node: Node, source: MeasuredSource):
        self._node = node
        self._source = source
        self.subscriptions = source.subscriptions
        self._reminder = Reminder()
        self._dropped: Counter[RejectReason] = Counter()
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', QoSProfile(depth=10))
        start_health_timer(node, self._report)

    def current(self, now: float) -> Opening:
        return self._source.current(now)

    def _report(self) -> None:
        now = time.monotonic()
        current = self.current(now)
        name, remedy = self._node.get_fully_qualified_name(), self._source.remedy
        if not math.isnan(current.gap):
            self._reminder.reset()
        elif self._reminder.is_due('unknown', now):
            logger.warning('%s: the opening of the gripper is not known: %s', name,
                           why_not_known(current, remedy))
        dropped = total(subscription.counts for subscription in self.subscriptions)
        message = DiagnosticArray(status=[opening_status(name, current, dropped, self._dropped, remedy)])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._dropped = dropped
        self._publisher.publish(message)


def _check(settings: GraspNodeSettings) -> None:
    source, joints, frames = settings.gap_source, settings.gap_joints, settings.gap_frames
    if source not in (*NAMES, NONE):
        raise ConfigurationError('parameter gap_source', expected=', '.join((*NAMES, NONE)), got=repr(source),
                                 remedy='Name where the opening of the gripper comes from.')
    if settings.gap >= 0 and source != 'parameter':
        raise ConfigurationError('parameter gap', expected=f'no value with gap_source {source}', got=f'{settings.gap}',
                                 remedy='Remove one of both: the opening has one source.')
    if source == 'joint_states' and (not all(joints) or not joints or len(set(joints)) < len(joints)):
        raise ConfigurationError('parameter gap_joints', expected='names of joints, each once', got=f'{list(joints)}',
                                 remedy='Take them from the URDF; leave out a mimic joint and double gap_scale.')
    if source == 'tf' and (len(frames) != 2 or not all(frames) or len(set(map(frame_name, frames))) < 2):
        raise ConfigurationError('parameter gap_frames', expected='a frame on the left and one on the right finger',
                                 got=f'{list(frames)}', remedy='Take both from the URDF.')
