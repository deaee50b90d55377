"""The topics of one pad that viewers draw: their messages are made while something subscribes to them."""

import time
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from sensor_msgs.msg import Image
from visualization_msgs.msg import MarkerArray

from tactile_node.colour_map import ColourScale, rgb_table
from tactile_node.contact.pattern import ContactPattern
from tactile_node.ros.qos import frames_qos
from tactile_node.ros.time_messages import seconds
from tactile_node.ros.view_messages import ContactMarkers, MarkerLifetime, colour_image, value_image, wrench_message
from tactile_skin.msg import Contact, ContactShape, TaxelArray

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


class TaxelViews:
    """``full_scale``: see ColourScale."""

    def __init__(self, node: Node, depth: int, full_scale: float):
        self._values = OnDemandPublisher(node, Image, 'image', depth)
        self._colours = OnDemandPublisher(node, Image, 'image_colour', depth)
        self._wrench = OnDemandPublisher(node, WrenchStamped, 'wrench', depth)
        self._scale, self._table = ColourScale(full_scale), rgb_table()

    def publish(self, taxels: TaxelArray, contact: Contact, pattern: ContactPattern) -> None:
        """Publish what is subscribed to of ``taxels``; ``contact`` and ``pattern`` are of them."""
        self._wrench.publish(lambda: wrench_message(contact, pattern))
        self._values.publish(lambda: value_image(taxels))
        self._colours.publish(lambda: colour_image(taxels, self._scale, self._table))


class ShapeView:
    """``full_scale``: see ColourScale."""

    def __init__(self, node: Node, depth: int, full_scale: float):
        self._publisher = OnDemandPublisher(node, MarkerArray, 'markers', depth)
        self._markers = ContactMarkers(ColourScale(full_scale))
        self._lifetime = MarkerLifetime()

    def publish(self, contact: Contact, shape: ContactShape) -> None:
        """Publish the markers of ``shape``, which is of ``contact``, if they are subscribed to."""
        self._publisher.publish(lambda: self._drawn(contact, shape))

    def _drawn(self, contact: Contact, shape: ContactShape) -> MarkerArray:
        lifetime = self._lifetime.after(time.monotonic(), seconds(contact.header.stamp))
        return self._markers.message(contact, shape, lifetime)
