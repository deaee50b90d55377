"""A publisher that creates its messages only while they are wanted."""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

from rclpy.node import Node
from rclpy.qos import QoSProfile

Message = TypeVar('Message')


class OnDemandPublisher(Generic[Message]):
    """Publishes messages on a topic only while the topic has subscribers.

    Parameters
    ----------
    node : Node
        Node that publishes.
    kind : type
        Type of the messages.
    topic : str
        Name of the topic.
    qos : QoSProfile
        QoS of the publisher.
    lossless : bool
        True to publish also without a subscriber, because late subscribers receive the earlier messages of a lossless
        replay.

    Attributes
    ----------
    topic : str
        Full name of the topic.
    """

    def __init__(self, node: Node, kind: type[Message], topic: str, qos: QoSProfile, *, lossless: bool = False):
        self._node, self._is_lossless = node, lossless
        self._publisher: Any = node.create_publisher(kind, topic, qos)
        self.topic: str = self._publisher.topic_name

    @property
    def is_wanted(self) -> bool:
        """True if a message that is published now can reach a subscriber."""
        return self._is_lossless or self._publisher.get_subscription_count() > 0

    def publish(self, make: Callable[..., Message], *args: object) -> None:
        """Publish the message that ``make(*args)`` returns. If the message is not wanted, ``make`` is not called."""
        if self.is_wanted:
            self._publisher.publish(make(*args))

    def destroy(self) -> None:
        """End the publisher."""
        self._node.destroy_publisher(self._publisher)
