"""Publish images, wrenches and markers for viewers.

Even in a lossless replay, these publishers do not keep earlier messages, because a viewer shows any image or marker as
the current state.
"""

import time

from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from sensor_msgs.msg import Image
from visualization_msgs.msg import MarkerArray

from tactile_node.colour_map import ColourScale
from tactile_node.nodes.on_demand_publisher import OnDemandPublisher
from tactile_node.ros.contact_messages import PadContact
from tactile_node.ros.qos import frames_qos
from tactile_node.ros.time_messages import seconds
from tactile_node.ros.view_messages import ContactMarkers, MarkerLifetime, colour_image, value_image, wrench_message
from tactile_skin.msg import ContactShape


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
        qos = frames_qos(depth)
        self._values = OnDemandPublisher(node, Image, 'image', qos)
        self._colours = OnDemandPublisher(node, Image, 'image_colour', qos)
        self._wrench = OnDemandPublisher(node, WrenchStamped, 'wrench', qos)
        self._scale = ColourScale(full_scale)

    @property
    def is_wanted(self) -> bool:
        """True while any of the topics has a subscriber."""
        return self._values.is_wanted or self._colours.is_wanted or self._wrench.is_wanted

    def publish(self, contact: PadContact) -> None:
        """Publish ``contact`` and its taxels on the topics that have subscribers."""
        self._wrench.publish(wrench_message, contact)
        self._values.publish(value_image, contact.frame)
        self._colours.publish(colour_image, contact.frame, self._scale)


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
        self._publisher = OnDemandPublisher(node, MarkerArray, 'markers', frames_qos(depth))
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
        self._publisher.publish(self._drawn, contact, shape)

    def _drawn(self, contact: PadContact, shape: ContactShape) -> MarkerArray:
        lifetime = self._lifetime.after(time.monotonic(), seconds(contact.header.stamp))
        return self._markers.message(contact, shape, lifetime)
