"""Features -> recognised shape, fused over time, with pose and size, on topics."""

import sys

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node

from tactile_node.fusion.recognitions import FusedRecognition, RecognitionFusion
from tactile_node.node_graph import NODE_NAMES, Role
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.node_health import MessageHealth
from tactile_node.nodes.run import run_node
from tactile_node.pose.fit import ShapeFit, fit_shape
from tactile_node.pose.moments import contact_moments
from tactile_node.ros.feature_messages import features_of, pattern_of
from tactile_node.ros.message_checks import check_contact_features
from tactile_node.ros.parameters import declare, read
from tactile_node.ros.settings import ClassifierSettings
from tactile_node.ros.shape_messages import Findings, pose_message, shape_message
from tactile_node.ros.time_messages import seconds
from tactile_node.shape.methods import make_recogniser
from tactile_node.shape.recognition import Recognition, Shape
from tactile_skin.msg import ContactFeatures, ContactShape


class ClassifierNode(Node):
    """Publishes `shape` for every usable message on `features`, and `pose` while the contact has one.

    Raises ConfigurationError for a wrong parameter.
    """

    def __init__(self, **options):
        super().__init__(NODE_NAMES[Role.CLASSIFIER], **options)
        declare(self, ClassifierSettings)
        self._settings = read(self, ClassifierSettings)
        self._recogniser = make_recogniser(self._settings.method, self._settings.model)
        self._fusion = RecognitionFusion()
        qos = self._settings.qos
        self.recognised = 0  #: messages published
        self._publisher = self.create_publisher(ContactShape, 'shape', qos)
        self._poses = self.create_publisher(PoseWithCovarianceStamped, 'pose', qos)
        subscription = GuardedSubscription(self, ContactFeatures, 'features', self._on_features, qos,
                                           check=check_contact_features)
        MessageHealth(self, [subscription])

    def _on_features(self, message: ContactFeatures) -> None:
        shape = shape_message(message, self._find(message), self._settings.method, self._settings.solid_height)
        self._publisher.publish(shape)
        if shape.fit_valid:
            self._poses.publish(pose_message(shape))
        self.recognised += 1

    def _find(self, message: ContactFeatures) -> Findings:
        pattern = pattern_of(message)
        frame = self._recogniser.recognise(pattern, features_of(message) if self._recogniser.groups else None)
        fused = self._fused(seconds(message.header.stamp), frame)
        moments = contact_moments(pattern.values, pattern.mask, message.pitch, message.unit)
        return Findings(frame, fused, self._fitted(message, pattern, fused.recognition.shape), moments)

    def _fused(self, stamp: float, frame: Recognition) -> FusedRecognition:
        if self._settings.fuse:
            return self._fusion.update(stamp, frame.probabilities)
        return FusedRecognition(frame, stamp, 0.0, 1)

    def _fitted(self, message: ContactFeatures, pattern, shape: Shape) -> ShapeFit | None:
        if not self._settings.fit or not pattern.mask.any():
            return None
        taxels = pattern.mask if message.unit == '1' else pattern.values
        return fit_shape(taxels, pattern.mask, shape, message.pitch)


def main() -> int:
    return run_node(ClassifierNode)


if __name__ == '__main__':
    sys.exit(main())
