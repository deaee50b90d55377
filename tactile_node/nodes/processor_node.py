"""The processor node finds the contacts in each taxel array, and computes features while they have subscribers."""

import logging
import sys
from collections.abc import Sequence
from typing import Any

from tactile_node.chain import Step
from tactile_node.contact.press import PressThresholds
from tactile_node.contact.unit_scale import UnitScale
from tactile_node.errors import ConfigurationError
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.node_graph import Role
from tactile_node.nodes.on_demand_publisher import OnDemandPublisher
from tactile_node.nodes.run import run_node
from tactile_node.nodes.stage import StageInput, StageOutput, Stages
from tactile_node.nodes.stage_node import StageNode
from tactile_node.nodes.view_topics import TaxelViews
from tactile_node.pose.pipeline import ContactPipeline
from tactile_node.ros.contact_messages import PadContact, PadFrame, contact_message, features_message, pad_frame_of
from tactile_node.ros.message_age import age_since
from tactile_node.ros.message_checks import check_taxel_array
from tactile_node.ros.parameters import declare, follow_changes, read
from tactile_node.ros.rosout_handler import of_node
from tactile_node.ros.settings import ProcessorSettings
from tactile_node.taxel_frame import PRESS_BY_UNIT, TaxelStatus
from tactile_skin.msg import Contact, ContactFeatures, TaxelArray

#: Largest number of frames of a pad that wait. Ten waiting frames at 50 Hz would delay data by 0.2 s, but a gripper
#: does not close on data older than 0.15 s.
MOST_WAITING = 2

logger = logging.getLogger(__name__)


class ProcessorNode(StageNode):
    """Publishes `contact` for every usable message on `taxels`, and `features` while that topic has subscribers.

    With the parameter `lossless`, the processor always publishes both topics, because late subscribers also receive the
    messages. Images and wrenches for viewers are published only while these topics have subscribers.

    The arguments are those of `StageNode`. The constructor raises ConfigurationError if a parameter is invalid.
    """

    def __init__(self, stages: Stages | None = None, **options: Any):
        super().__init__(Role.PROCESSOR, stages, **options)
        declare(self, ProcessorSettings)
        self._settings = settings = read(self, ProcessorSettings)
        self._groups = feature_groups(settings.features)
        self._pipeline = ContactPipeline(thresholds=thresholds_of(settings), smallest_contact=settings.smallest_contact)
        self._scales = scales_of(settings)
        self._contacts = StageOutput(self, Contact, 'contact', self._settings, contact_message, self._stages)
        self._features = OnDemandPublisher(self, ContactFeatures, 'features', settings.qos, lossless=settings.lossless)
        self._views = TaxelViews(self, self._settings.queue_depth, self._settings.full_scale)
        self._taxels = StageInput(self, TaxelArray, 'taxels', self.accept, self._settings, check=check_taxel_array,
                                  parse=pad_frame_of, stages=self._stages, step=Step.FIND,
                                  most_waiting=MOST_WAITING, sends_on=self._contacts.topic)
        self.begin_stage(settings, [self._taxels], self._contacts)
        follow_changes(self, ProcessorSettings, check, lambda changed: self._stages.chain.post(self._apply, changed))

    def _apply(self, settings: ProcessorSettings) -> None:
        """Apply only the changed settings, so that the pipeline keeps its knowledge of the pad."""
        before, self._settings = self._settings, settings
        self._groups = feature_groups(settings.features)
        self._pipeline.set_contact_limits(thresholds_of(settings), settings.smallest_contact)
        if settings.press_threshold != before.press_threshold:
            self._scales = scales_of(settings)

    def accept(self, frame: PadFrame) -> None:
        """Find the contacts in ``frame``, publish them and hand them over."""
        unit, values = frame.taxels.unit or '', frame.values
        if unit in self._scales and (error := self._scales[unit].doubt(values)):
            logger.warning('%s: %s', self._taxels.topic, error, extra=of_node(self, fact=error))
            self._scales = {}  # the warning is logged only once
        found = self._pipeline.find(values, frame.taxels, saturated=frame.status == TaxelStatus.SATURATED.value,
                                    unmapped=frame.status == TaxelStatus.UNMAPPED.value)
        contact = PadContact.of(frame, found)
        self._contacts.send(contact)
        if self._views.is_wanted or self._features.is_wanted:
            self._taxels.postpone(Step.SHOW, contact.acquired, self._publish_more, contact)

    def _publish_more(self, contact: PadContact) -> None:
        """Publish features, images and wrenches, which no other stage waits for."""
        self._features.publish(self._features_of, contact)
        self._views.publish(contact)

    def _features_of(self, contact: PadContact) -> ContactFeatures:
        features = features_message(contact, compute_features(contact.found.pattern.mask, self._groups))
        features.age = age_since(contact.acquired)
        return features


def check(settings: ProcessorSettings) -> None:
    """Raise ConfigurationError if the settings cannot be applied."""
    feature_groups(settings.features)
    thresholds_of(settings)


def thresholds_of(settings: ProcessorSettings) -> PressThresholds | None:
    """Return the fixed thresholds, or None if the pipeline derives the thresholds from the noise."""
    press = settings.press_threshold
    return PressThresholds(press, press * settings.release_ratio) if press else None


def scales_of(settings: ProcessorSettings) -> dict[str, UnitScale]:
    """Return a check for each unit that the readings have a plausible scale.

    With fixed thresholds, the readings may have any scale, so the function returns no checks.
    """
    return {} if settings.press_threshold else {unit: UnitScale(unit, most=1.0) for unit in PRESS_BY_UNIT}


def feature_groups(names: Sequence[str]) -> Group:
    """Return the named feature groups, together with the group that the classifier uses.

    Raises ConfigurationError if a name is unknown.
    """
    groups = Group.CLASSIFIER
    for name in names:
        if name.upper() not in Group.__members__:
            raise ConfigurationError('parameter features', expected='names of ' + ', '.join(Group.__members__).lower(),
                                     got=repr(name), remedy='`tactile features --help` explains each group.')
        groups |= Group[name.upper()]
    return groups


def main() -> int:
    """Run the node and return the exit code."""
    return run_node(ProcessorNode)


if __name__ == '__main__':
    sys.exit(main())
