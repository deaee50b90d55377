"""Contact -> recognised shape, fused over time, with pose and size, on topics."""

import sys
import time

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node

from tactile_node.node_graph import NODE_NAMES, Role
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.node_health import MessageHealth
from tactile_node.nodes.run import run_node
from tactile_node.nodes.view_topics import ShapeView
from tactile_node.pose.pipeline import DEFAULT_FUSION, ContactPipeline, StreamedContact
from tactile_node.ros.contact_messages import contact_of
from tactile_node.ros.message_age import age_message
from tactile_node.ros.message_checks import check_contact
from tactile_node.ros.parameters import declare, read
from tactile_node.ros.settings import ClassifierSettings
from tactile_node.ros.shape_messages import MOST_SHAPES, pose_message, shape_message, shapes_message
from tactile_node.ros.time_messages import seconds
from tactile_node.shape.methods import make_recogniser
from tactile_skin.msg import Contact, ContactShape, ContactShapes, Progress


class ClassifierNode(Node):
    """Publishes `shape` for the newest usable message on `contact`, and `pose` while the contact has one.

    While something subscribes to them, `shapes` too, each of the largest contacts, and `markers`. A lossless classifier
    answers every message, always publishes `shapes`, since it keeps messages for late subscribers, and `progress`,
    which the driver waits for. Raises ConfigurationError for a wrong parameter.
    """

    def __init__(self, **options):
        super().__init__(NODE_NAMES[Role.CLASSIFIER], **options)
        declare(self, ClassifierSettings)
        self._settings = read(self, ClassifierSettings)
        self._pipeline = ContactPipeline(
            make_recogniser(self._settings.method, self._settings.model), fits=self._settings.fit,
            fusion=DEFAULT_FUSION if self._settings.fuse else None)
        qos = self._settings.qos
        self.recognised = 0  #: messages published on `shape`
        self._publisher = self.create_publisher(ContactShape, 'shape', qos)
        self._poses = self.create_publisher(PoseWithCovarianceStamped, 'pose', qos)
        self._all_shapes = self.create_publisher(ContactShapes, 'shapes', qos)
        self._progress = self.create_publisher(Progress, 'progress', qos) if self._settings.lossless else None
        self._view = ShapeView(self, self._settings.queue_depth, self._settings.full_scale)
        self._contacts = GuardedSubscription(self, Contact, 'contact', self._on_contact, self._settings.input_qos,
                                             check=check_contact, newest_only=True)
        MessageHealth(self, [self._contacts], self._settings)

    def _on_contact(self, message: Contact) -> None:
        result = self._pipeline.recognise(contact_of(message), seconds(message.header.stamp))
        shape = self._message(message, result)
        shape.left_out = self._contacts.left_out
        self._publisher.publish(shape)
        if shape.fit_valid:
            self._poses.publish(pose_message(shape))
        self.recognised += 1
        if self._settings.lossless or self._all_shapes.get_subscription_count():  # a late subscriber gets all
            self._publish_all(message, result)
        if self._progress is not None:
            self._progress.publish(Progress(sequence=message.sequence))
        self._view.publish(message, shape)

    def _publish_all(self, message: Contact, largest: StreamedContact) -> None:
        results = self._pipeline.recognise_each(largest, seconds(message.header.stamp), MOST_SHAPES)
        together = shapes_message(message, largest.contact.contacts, [self._message(message, each) for each in results])
        together.age = self._age()
        self._all_shapes.publish(together)

    def _message(self, message: Contact, result: StreamedContact) -> ContactShape:
        shape = shape_message(message, result, self._settings.method, self._settings.solid_height)
        shape.age = self._age()
        return shape

    def _age(self) -> Duration:
        """Return the age of what is made of the present message, when it is sent."""
        return age_message(self._contacts.arrival.age(time.monotonic()))


def main() -> int:
    return run_node(ClassifierNode)


if __name__ == '__main__':
    sys.exit(main())
