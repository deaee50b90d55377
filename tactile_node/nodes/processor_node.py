"""Taxel array -> contact pattern, and its features while something subscribes to them, on topics."""

import logging
import sys
import time
from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from tactile_node.contact.press import PressThresholds
from tactile_node.contact.scale import UnitScale
from tactile_node.errors import ConfigurationError, TactileError
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.node_graph import NODE_NAMES, Role
from tactile_node.nodes.hand_over import HandOver, StageInput, StageNode, StageOutput
from tactile_node.nodes.node_health import MessageHealth
from tactile_node.nodes.run import run_node
from tactile_node.nodes.view_topics import TaxelViews
from tactile_node.pose.pipeline import ContactPipeline
from tactile_node.ros.contact_messages import (
    PadContact,
    PadFrame,
    contact_message,
    features_message,
    find_in,
    pad_frame_of,
)
from tactile_node.ros.message_age import age_message
from tactile_node.ros.message_checks import check_taxel_array
from tactile_node.ros.parameters import changed, declare, read
from tactile_node.ros.qos import is_wanted
from tactile_node.ros.settings import ProcessorSettings
from tactile_node.taxel_frame import PRESS_BY_UNIT
from tactile_skin.msg import Contact, ContactFeatures, TaxelArray

logger = logging.getLogger(__name__)


class ProcessorNode(StageNode):
    """Publishes `contact` for every usable frame on `taxels`, and `features` while something subscribes to it.

    A lossless one always publishes both, since it keeps them for late subscribers. What viewers draw of the taxels it
    publishes only while something subscribes to it. ``hand_over``: from and to the nodes of this process. Raises
    ConfigurationError for a wrong parameter.
    """

    def __init__(self, hand_over: HandOver | None = None, **options: Any):
        super().__init__(NODE_NAMES[Role.PROCESSOR], **options)
        declare(self, ProcessorSettings)
        self._apply(read(self, ProcessorSettings))
        hand_over = hand_over or HandOver()
        self._contacts = StageOutput(self, Contact, 'contact', self._settings, contact_message, hand_over)
        self._features = self.create_publisher(ContactFeatures, 'features', self._settings.qos)
        self._views = TaxelViews(self, self._settings.queue_depth, self._settings.full_scale)
        self._taxels = StageInput(self, TaxelArray, 'taxels', self.accept, self._settings, check=check_taxel_array,
                                  parse=pad_frame_of, hand_over=hand_over)
        self._taxels.sends_on = self._contacts.topic
        self.stages = self._taxels, self._contacts
        MessageHealth(self, [self._taxels], self._settings)
        self.add_on_set_parameters_callback(self._on_parameters)

    def _apply(self, settings: ProcessorSettings) -> None:
        """Apply ``settings`` as a whole or not at all; the contact in progress is then found again."""
        groups = feature_groups(settings.features)
        press, ratio = settings.press_threshold, settings.release_ratio
        thresholds = PressThresholds(press, press * ratio) if press else None
        self._pipeline = ContactPipeline(thresholds=thresholds, smallest_contact=settings.smallest_contact)
        self._settings = settings
        self._groups = groups
        self._scales = {} if press else {unit: UnitScale(unit, most=1.0) for unit in PRESS_BY_UNIT}

    def _on_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self._apply(changed(read(self, ProcessorSettings), parameters))
        except TactileError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def accept(self, frame: PadFrame) -> None:
        """Find the contact in ``frame`` and send it on."""
        unit, values = frame.taxels.unit or '', frame.values
        if unit in self._scales and (error := self._scales[unit].doubt(values)):
            logger.warning('%s: %s', self._taxels.topic, error, extra={'fact': error})
            self._scales = {}  # once
        contact = PadContact(frame, find_in(frame, self._pipeline), self._taxels.left_out)
        self._contacts.send(contact, self._taxels.arrival.acquired)
        if is_wanted(self._features, self._settings.lossless):
            features = features_message(contact, compute_features(contact.found.pattern.mask, self._groups))
            features.age = age_message(self._taxels.arrival.age(time.monotonic()))
            self._features.publish(features)
        self._views.publish(contact)


def feature_groups(names: Sequence[str]) -> Group:
    """Return the named groups and the classifier's. Raises ConfigurationError for an unknown name."""
    groups = Group.CLASSIFIER
    for name in names:
        if name.upper() not in Group.__members__:
            raise ConfigurationError('parameter features', expected='names of ' + ', '.join(Group.__members__).lower(),
                                     got=repr(name), remedy='See `tactile features --help` for what each computes.')
        groups |= Group[name.upper()]
    return groups


def main() -> int:
    return run_node(ProcessorNode)


if __name__ == '__main__':
    sys.exit(main())
