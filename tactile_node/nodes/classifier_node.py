"""The classifier node recognises the shape of each contact, fuses the shape over time, and fits pose and size."""

import sys
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped

from tactile_node.chain import Step
from tactile_node.node_graph import Role
from tactile_node.nodes.on_demand_publisher import OnDemandPublisher
from tactile_node.nodes.run import run_node
from tactile_node.nodes.stage import StageInput, StageOutput, Stages
from tactile_node.nodes.stage_node import StageNode
from tactile_node.nodes.view_topics import ShapeView
from tactile_node.pose.events import Event
from tactile_node.pose.pipeline import DEFAULT_FUSION, ContactPipeline, StreamedContact
from tactile_node.ros.contact_messages import PadContact, pad_contact_of
from tactile_node.ros.message_age import age_since
from tactile_node.ros.message_checks import check_contact
from tactile_node.ros.motion_messages import event_message
from tactile_node.ros.parameters import declare, read
from tactile_node.ros.qos import frames_qos
from tactile_node.ros.settings import ClassifierSettings
from tactile_node.ros.shape_messages import MOST_SHAPES, PadShape, pose_message, shapes_message
from tactile_node.ros.time_messages import seconds
from tactile_node.shape.methods import make_recogniser
from tactile_skin.msg import Contact, ContactEvent, ContactShape, ContactShapes

EVENT_DEPTH = 10  #: Queue depth of the event publisher [messages].


class ClassifierNode(StageNode):
    """Publishes `shape` for the newest usable message on `contact`, `pose` if a shape was fitted, and `events`.

    While these topics have subscribers, the node also publishes `markers` and `shapes`, which lists the shapes of the
    largest contacts of a pad. With the parameter `lossless`, the node processes every contact, and publishes `shapes`
    even without a subscriber, because late subscribers also receive the messages.

    The arguments are those of `StageNode`. The constructor raises ConfigurationError if a parameter is invalid.
    """

    def __init__(self, stages: Stages | None = None, **options: Any):
        super().__init__(Role.CLASSIFIER, stages, **options)
        declare(self, ClassifierSettings)
        self._settings = read(self, ClassifierSettings)
        self._pipeline = ContactPipeline(
            make_recogniser(self._settings.method, self._settings.model), fits=self._settings.fit,
            fusion=DEFAULT_FUSION if self._settings.fuse else None, shift_per_load=self._settings.shift_per_load)
        qos, lossless = self._settings.qos, self._settings.lossless
        self.recognised = 0  #: number of contacts for which a shape was published
        self._shapes: StageOutput[PadShape] = StageOutput(self, ContactShape, 'shape', self._settings,
                                                          lambda shape: shape.message, self._stages)
        self._poses = OnDemandPublisher(self, PoseWithCovarianceStamped, 'pose', qos, lossless=lossless)
        self._all_shapes = OnDemandPublisher(self, ContactShapes, 'shapes', qos, lossless=lossless)
        self._events = self.create_publisher(ContactEvent, 'events', frames_qos(EVENT_DEPTH, lossless))
        self._view = ShapeView(self, self._settings.queue_depth, self._settings.full_scale)
        self._contacts = StageInput(self, Contact, 'contact', self.accept, self._settings, check=check_contact,
                                    parse=pad_contact_of, stages=self._stages, step=Step.RECOGNISE)
        self.begin_stage(self._settings, [self._contacts], self._shapes)

    def accept(self, contact: PadContact) -> None:
        """Recognise the shape of ``contact`` and publish the result."""
        result = self._pipeline.recognise(contact.found, seconds(contact.header.stamp))
        shape = self._shape(contact, result)
        try:
            self._shapes.send(shape)
        finally:  # no later frame reports these events again
            for event in result.motion.events:
                self._contacts.attempt(self._publish_event, event, contact)
        if shape.centre is not None:
            self._poses.publish(lambda: pose_message(shape.message))
        self.recognised += 1
        if self._view.is_wanted or self._all_shapes.is_wanted:
            self._contacts.postpone(Step.SHOW, contact.acquired, self._publish_more, contact, result, shape)

    def _publish_event(self, event: Event, contact: PadContact) -> None:
        self._events.publish(event_message(event, contact.header, contact.sequence, age_since(contact.acquired)))

    def _publish_more(self, contact: PadContact, result: StreamedContact, shape: PadShape) -> None:
        """Publish `shapes` and `markers`, which no other stage waits for."""
        self._all_shapes.publish(self._all_shapes_of, contact, result)
        if self._view.is_wanted:
            self._view.publish(contact, shape.message)

    def _all_shapes_of(self, contact: PadContact, largest: StreamedContact) -> ContactShapes:
        results = self._pipeline.recognise_each(largest, seconds(contact.header.stamp), MOST_SHAPES)
        shapes = [self._shape(contact, each).message for each in results]
        together = shapes_message(contact, largest.found.pattern.contacts, shapes)
        together.age = age_since(contact.acquired)
        return together

    def _shape(self, contact: PadContact, result: StreamedContact) -> PadShape:
        return PadShape.of(contact, result, self._settings.method, self._settings.solid_height)


def main() -> int:
    """Run the node and return the exit code."""
    return run_node(ClassifierNode)


if __name__ == '__main__':
    sys.exit(main())
