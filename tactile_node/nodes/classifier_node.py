"""Features -> recognised shape, on topics."""

import sys

from rclpy.node import Node

from tactile_node.config import config_path
from tactile_node.nodes.run import run_node
from tactile_node.ros.messages import features_of, shape_message
from tactile_node.ros.parameters import CLASSIFIER, declare, values
from tactile_node.ros.qos import frames_qos
from tactile_node.shape.volf import VolfClassifier
from tactile_skin.msg import ContactFeatures, ContactShape


class ClassifierNode(Node):
    """Publishes `shape` for every message on `features`. Raises ConfigurationError for a wrong parameter."""

    def __init__(self, **options):
        super().__init__('classifier', **options)
        declare(self, CLASSIFIER)
        settings = values(self, CLASSIFIER)
        self._classifier, self._method = VolfClassifier.from_file(config_path(settings.curves)), settings.method
        qos = frames_qos(settings.queue_depth, settings.lossless)
        self.recognised = 0  #: messages published
        self._publisher = self.create_publisher(ContactShape, 'shape', qos)
        self.create_subscription(ContactFeatures, 'features', self._on_features, qos)

    def _on_features(self, message: ContactFeatures) -> None:
        recognition = self._classifier.recognise(features_of(message))
        self._publisher.publish(shape_message(message, recognition, self._method))
        self.recognised += 1


def main() -> int:
    return run_node(ClassifierNode)


if __name__ == '__main__':
    sys.exit(main())
