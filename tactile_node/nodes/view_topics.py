"""Publish images, wrenches and markers for viewers."""

import time
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from sensor_msgs.msg import Image
from visualization_msgs.msg import MarkerArray

from tactile_node.colour_map import ColourScale
from tactile_node.ros.contact_messages import PadContact
from tactile_node.ros.qos import frames_qos
from tactile_node.ros.time_messages import seconds
from tactile_node.ros.view_messages import ContactMarkers, MarkerLifetime, colour_image, value_image, wrench_message
from tactile_skin.msg import ContactShape

Message = TypeVar('Message')


class OnDemandPublisher(Generic[Message]):
    """Publishes messages on a topic only while the topic has subscribers.

    A late subscriber receives no earlier messages.

    Even in a lossless replay, earlier messages are not kept, because a viewer shows any image or marker as the current
    state.

    Parameters
    ----------
    node : Node
        Node that publishes.
    kind : type
        Type of the messages.
    topic : str
        Name of the topic.
    depth : int
        Queue depth of the publisher [messages].
    """

    def __init__(self, node: Node, kind: type[Message], topic: str, depth: int):
        self._publisher: Any = node.create_publisher(kind, topic, frames_qos(depth))

    @property
    def is_wanted(self) -> bool:
        """True while the topic has a subscriber."""
        return self._publisher.get_subscription_count() > 0

    def publish(self, make: Callable[[], Message]) -> None:
        """Publish the message that ``make`` returns. If the topic has no subscriber, ``make`` is not called."""
        if self.is_wanted:
            self._publisher.publish(make())


class TaxelViews:
    """Publishes the taxels of a pad as `image`, `image_colour` and `wrench`.

    Parameters
    ----------
    node : Node
        Node that publishes.
    depth : int
        Queue depth of each publisher [messages].
    full_scale : float
        Reading that is shown in the brightest colour; see `ColourScale`.
    """

    def __init__(self, node: Node, depth: int, full_scale: float):
        self._values = OnDemandPublisher(node, Image, 'image', depth)
        self._colours = OnDemandPublisher(node, Image, 'image_colour', depth)
        self._wrench = OnDemandPublisher(node, WrenchStamped, 'wrench', depth)
        self._scale = ColourScale(full_scale)

    @property
    def is_wanted(self) -> bool:
        """True while any of the topics has a subscriber."""
        return self._values.is_wanted or self._colours.is_wanted or self._wrench.is_wanted

    def publish(self, contact: PadContact) -> None:
        """Publish ``contact`` and its taxels on the topics that have subscribers."""
        self._wrench.publish(lambda: wrench_message(contact))
        self._values.publish(lambda: value_image(contact.frame))
        self._colours.publish(lambda: colour_image(contact.frame, self._scale))


class ShapeView:
    """Publishes the shape on a pad as `markers`.

    Parameters
    ----------
    node : Node
        Node that publishes.
    depth : int
        Queue depth of the publisher [messages].
    full_scale : float
        Reading that is shown in the brightest colour; see `ColourScale`.
    """

    def __init__(self, node: Node, depth: int, full_scale: float):
        self._publisher = OnDemandPublisher(node, MarkerArray, 'markers', depth)
        self._markers = ContactMarkers(ColourScale(full_scale))
        self._lifetime = MarkerLifetime()

    @property
    def is_wanted(self) -> bool:
        """True while the markers have a subscriber."""
        return self._publisher.is_wanted

    def publish(self, contact: PadContact, shape: ContactShape) -> None:
        """Publish the markers of a contact if the topic has a subscriber.

        Parameters
        ----------
        contact : PadContact
            Contact on the pad.
        shape : ContactShape
            Shape that was recognised from the contact.
        """
        self._publisher.publish(lambda: self._drawn(contact, shape))

    def _drawn(self, contact: PadContact, shape: ContactShape) -> MarkerArray:
        lifetime = self._lifetime.after(time.monotonic(), seconds(contact.header.stamp))
        return self._markers.message(contact, shape, lifetime)
