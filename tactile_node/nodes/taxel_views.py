"""The topics of one pad that viewers draw, of its taxels: `image`, `image_colour` and `wrench`."""

from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from sensor_msgs.msg import Image

from tactile_node.colour_map import ColourScale, rgb_table
from tactile_node.contact.pattern import ContactPattern
from tactile_node.nodes.on_demand import OnDemandPublisher
from tactile_node.ros.image_messages import colour_image, value_image
from tactile_node.ros.wrench_messages import wrench_message
from tactile_skin.msg import Contact, TaxelArray


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
