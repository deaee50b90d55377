"""What the driver publishes about itself: /diagnostics and `~/status`."""

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile

from tactile_node.conditioning.conditioned_pad import PadCondition
from tactile_node.errors import TactileError
from tactile_node.frames.fault_text import failure_of
from tactile_node.frames.frame_source import FrameSource
from tactile_node.frames.health import BusHealth
from tactile_node.frames.losses import BusStatistics
from tactile_node.ros.diagnostics import BusDiagnostics, unconfigured
from tactile_node.ros.qos import STATUS_QOS
from tactile_node.ros.status_message import status_message
from tactile_skin.msg import SkinStatus


class StatePublisher:
    """Publishes both messages of one state, with one stamp; the publishers last as long as the node."""

    def __init__(self, node: Node):
        self._node = node
        self._findings = BusDiagnostics(node.get_name(), '')
        self._diagnostics = node.create_publisher(DiagnosticArray, '/diagnostics', QoSProfile(depth=10))
        self._status = node.create_publisher(SkinStatus, '~/status', STATUS_QOS)

    def begin(self, hardware_id: str) -> None:
        """Count from zero again, for a newly configured source."""
        self._findings = BusDiagnostics(self._node.get_name(), hardware_id)

    def publish(self, source: FrameSource | None, error: TactileError | None,
                conditions: Mapping[str, PadCondition]) -> None:
        """``source`` None: the driver is unconfigured, because of ``error`` where there is one."""
        if source is None:
            failure = None if error is None else failure_of(error)
            counts, health = BusStatistics({}, {}), BusHealth(failure, is_active=False)
            message = unconfigured(self._node.get_name(), health)
        else:
            counts, health = source.statistics(), source.health()
            message = self._findings.message(counts, health, conditions)
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._diagnostics.publish(message)
        self._status.publish(status_message(message, counts, health, conditions))
