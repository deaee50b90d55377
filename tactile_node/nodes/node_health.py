"""The diagnostic of a node that processes messages: /diagnostics, once a second."""

from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile

from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.health_timer import start_health_timer
from tactile_node.ros.message_health import MessageCounts, health_status


class MessageHealth:
    """Publishes what ``node`` does with the messages of ``subscriptions``; it lasts as long as the node."""

    def __init__(self, node: Node, subscriptions: Sequence[GuardedSubscription]):
        self._node = node
        self._subscriptions = tuple(subscriptions)
        self._before = self._counts()
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', QoSProfile(depth=10))
        start_health_timer(node, self._publish)

    def _counts(self) -> dict[str, MessageCounts]:
        return {subscription.topic: subscription.counts for subscription in self._subscriptions}

    def _publish(self) -> None:
        now = self._counts()
        message = DiagnosticArray(status=[health_status(self._node.get_fully_qualified_name(), now, self._before)])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._before = now
        self._publisher.publish(message)
