"""Topics whose messages are made while something subscribes to them."""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from rclpy.node import Node

from tactile_node.ros.qos import frames_qos

Message = TypeVar('Message')


class OnDemandPublisher(Generic[Message]):
    """Publishes on ``topic``; a subscriber that comes late gets nothing of before, also in a lossless replay.

    What an image or a marker shows is taken for the present: it is never kept for later.
    """

    def __init__(self, node: Node, kind: type[Message], topic: str, depth: int):
        self._publisher: Any = node.create_publisher(kind, topic, frames_qos(depth))

    def publish(self, make: Callable[[], Message]) -> None:
        """Publish what ``make`` returns; it is not called while nothing subscribes."""
        if self._publisher.get_subscription_count():
            self._publisher.publish(make())
