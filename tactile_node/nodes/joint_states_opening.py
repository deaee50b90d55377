"""The opening of the gripper from the positions of its joints."""

import math
import time

from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from tactile_node.grasp.opening import GapSource, LatestGap, LinearGap, Opening
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.ros.measurement_time import MeasurementTime, use_stamps
from tactile_node.ros.message_checks import RejectReason, check_joint_state
from tactile_node.ros.opening_messages import sum_of_positions
from tactile_node.ros.settings import GraspNodeSettings
from tactile_node.ros.time_messages import seconds


class JointStatesOpening:
    """The sum of joint positions. Messages of other joints pass, for many nodes may share the topic."""

    def __init__(self, node: Node, settings: GraspNodeSettings, law: LinearGap):
        self._joints = settings.gap_joints
        self._law = law
        self._latest = LatestGap(GapSource.JOINT_STATES, settings.max_gap_age)
        self._measured = MeasurementTime(use_stamps=use_stamps(node, settings))
        self.subscriptions = (GuardedSubscription(node, JointState, settings.joint_states_topic, self._on_state,
                                                  qos_profile_sensor_data, check=self._check),)
        self.remedy = f'no usable joint states of {", ".join(self._joints)} on {self.subscriptions[0].topic}'

    def current(self, now: float) -> Opening:
        return self._latest.current(now)

    def _check(self, message: JointState) -> RejectReason | None:
        if self._is_of_others(message) and not math.isnan(self.current(time.monotonic()).gap):
            return None
        return check_joint_state(message, self._joints, self._law)

    def _on_state(self, message: JointState) -> None:
        if not self._is_of_others(message):
            measured = self._measured.of(seconds(message.header.stamp), time.monotonic())
            self._latest.set(self._law.gap(sum_of_positions(message, self._joints)), measured)

    def _is_of_others(self, message: JointState) -> bool:
        return set(self._joints).isdisjoint(message.name)
