"""The topic `markers` of one pad, which viewers draw."""

import time

from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from tactile_node.colour_map import ColourScale
from tactile_node.nodes.on_demand import OnDemandPublisher
from tactile_node.ros.marker_lifetime import MarkerLifetime
from tactile_node.ros.marker_messages import ContactMarkers
from tactile_node.ros.time_messages import seconds
from tactile_skin.msg import Contact, ContactShape


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
