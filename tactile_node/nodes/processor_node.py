"""Taxel array -> contact pattern -> features, on topics."""

import sys

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.errors import TactileError
from tactile_node.helmholtz.features import compute_features
from tactile_node.nodes.run import run_node
from tactile_node.ros.feature_messages import features_message
from tactile_node.ros.parameters import PRESSED_BY_UNIT, PROCESSOR, declare, feature_groups, pressed_thresholds, values
from tactile_node.ros.qos import frames_qos
from tactile_node.ros.taxel_messages import taxel_values
from tactile_skin.msg import ContactFeatures, TaxelArray


class ProcessorNode(Node):
    """Publishes `features` for every message on `taxels`. Raises ConfigurationError for a wrong parameter."""

    def __init__(self, **options):
        super().__init__('processor', **options)
        declare(self, PROCESSOR)
        self._apply(values(self, PROCESSOR))
        qos = frames_qos(self._settings.queue_depth, self._settings.lossless)
        self._publisher = self.create_publisher(ContactFeatures, 'features', qos)
        self.create_subscription(TaxelArray, 'taxels', self._on_taxels, qos)
        self.add_on_set_parameters_callback(self._on_parameters)

    def _apply(self, settings) -> None:
        """Take ``settings`` whole or not at all; the contact in progress is found anew with them."""
        groups = feature_groups(settings.features)
        extractors = {unit: PatternExtractor(*pressed_thresholds(settings, unit)) for unit in PRESSED_BY_UNIT}
        self._settings, self._groups, self._extractors = settings, groups, extractors

    def _on_parameters(self, parameters) -> SetParametersResult:
        changed = {parameter.name: parameter.value for parameter in parameters}
        settings = values(self, PROCESSOR)
        vars(settings).update((name, value) for name, value in changed.items() if hasattr(settings, name))
        try:
            self._apply(settings)
        except TactileError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _on_taxels(self, message: TaxelArray) -> None:
        pattern = self._extractors[message.unit].extract(taxel_values(message))
        features = compute_features(pattern.mask, self._groups)
        self._publisher.publish(features_message(message, pattern, features))


def main() -> int:
    return run_node(ProcessorNode)


if __name__ == '__main__':
    sys.exit(main())
