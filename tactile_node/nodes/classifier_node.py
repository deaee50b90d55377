"""Contact -> recognised shape, fused over time, with pose and size, on topics."""

import sys
import time

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node

from tactile_node.contact.pattern import ContactPattern, of_contact
from tactile_node.contact.visibility import Visibility, visibility_of
from tactile_node.node_graph import NODE_NAMES, Role
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.node_health import MessageHealth
from tactile_node.nodes.run import run_node
from tactile_node.nodes.view_topics import ShapeView
from tactile_node.pose.box import contact_box
from tactile_node.pose.fit import ShapeFit, fit_contact
from tactile_node.pose.moments import contact_moments
from tactile_node.ros.contact_messages import layer_of, pattern_of
from tactile_node.ros.message_age import age_message
from tactile_node.ros.message_checks import check_contact
from tactile_node.ros.parameters import declare, read
from tactile_node.ros.settings import ClassifierSettings
from tactile_node.ros.shape_messages import MOST_SHAPES, Findings, pose_message, shape_message, shapes_message
from tactile_node.ros.time_messages import seconds
from tactile_node.shape.methods import make_recogniser
from tactile_node.shape.patch import join_pieces
from tactile_node.shape.recognition import Recognition, ShapeClass
from tactile_node.shape.recognitions import FusedRecognition, RecognitionFusion
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
        self._recogniser = make_recogniser(self._settings.method, self._settings.model)
        self._fusion = RecognitionFusion()
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
        pattern = pattern_of(message)
        seen = _visibility(message, pattern)
        frame = self._recogniser.recognise(pattern, visibility=seen)
        if frame.joined:
            pattern = join_pieces(pattern)
            seen = _visibility(message, pattern)
        fused = self._fused(seconds(message.header.stamp), frame)
        shape = self._message(message, pattern, seen, frame=frame, fused=fused)
        shape.left_out = self._contacts.left_out
        self._publisher.publish(shape)
        if shape.fit_valid:
            self._poses.publish(pose_message(shape))
        self.recognised += 1
        if self._settings.lossless or self._all_shapes.get_subscription_count():  # a late subscriber gets all
            self._publish_all(message, pattern, frame)
        if self._progress is not None:
            self._progress.publish(Progress(sequence=message.sequence))
        self._view.publish(message, shape)

    def _publish_all(self, message: Contact, pattern: ContactPattern, largest: Recognition) -> None:
        """Each contact by this frame alone; ``largest`` is the recognition of the first."""
        shapes = []
        for number in range(1, min(pattern.contacts, MOST_SHAPES) + 1):
            contact = of_contact(pattern, number)
            seen = _visibility(message, contact)
            frame = largest if number == 1 else self._recogniser.recognise(contact._replace(contacts=1),
                                                                           visibility=seen)
            fused = FusedRecognition(frame, seconds(message.header.stamp), 0.0, 1)
            shapes.append(self._message(message, contact, seen, frame=frame, fused=fused))
        together = shapes_message(message, pattern.contacts, shapes)
        together.age = self._age()
        self._all_shapes.publish(together)

    def _message(self, message: Contact, pattern: ContactPattern, seen: Visibility, *, frame: Recognition,
                 fused: FusedRecognition) -> ContactShape:
        moments = contact_moments(pattern.values, pattern.mask, message.pitch, message.unit, seen,
                                  pattern.noise)
        found = Findings(frame=frame, fused=fused, fit=self._fitted(message, pattern, seen, fused.recognition.shape),
                         moments=moments, visibility=seen, pattern=pattern,
                         box=contact_box(pattern, message.pitch, seen))
        shape = shape_message(message, found, self._settings.method, self._settings.solid_height)
        shape.age = self._age()
        return shape

    def _age(self) -> Duration:
        """Return the age of what is made of the present message, when it is sent."""
        return age_message(self._contacts.arrival.age(time.monotonic()))

    def _fused(self, stamp: float, frame: Recognition) -> FusedRecognition:
        if self._settings.fuse:
            return self._fusion.update(stamp, frame)
        return FusedRecognition(frame, stamp, 0.0, 1)

    def _fitted(self, message: Contact, pattern: ContactPattern, seen: Visibility,
                shape: ShapeClass) -> ShapeFit | None:
        if not self._settings.fit or not pattern.mask.any():
            return None
        return fit_contact(pattern, shape, message.pitch, layer_of(message), seen)


def _visibility(message: Contact, pattern: ContactPattern) -> Visibility:
    """Whether the pad was seen is the processor's to decide."""
    return visibility_of(pattern, message.smallest_contact)._replace(pad_seen=message.pad_seen)


def main() -> int:
    return run_node(ClassifierNode)


if __name__ == '__main__':
    sys.exit(main())
