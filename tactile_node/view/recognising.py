"""Taxel frame -> state of a pad, by the library: for sources without ROS nodes that recognise."""

import numpy as np

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.visibility import visibility_of
from tactile_node.frames.taxel_frame import TaxelFrame, TaxelStatus
from tactile_node.library.contacts import Recogniser
from tactile_node.library.stream import ContactFollower, StreamedContact
from tactile_node.pose.moments import contact_moments
from tactile_node.shape.recognition import Shape
from tactile_node.view.states import PadState, SeenContact


class PadRecogniser:
    """Recognises what touches one pad, frame by frame; ``recogniser`` may be shared by several pads."""

    def __init__(self, pad: str, pitch: float, unit: str, recogniser: Recogniser):
        self._pad, self._pitch, self._unit = pad, pitch, unit
        self._recogniser = recogniser
        self.restart()

    def restart(self) -> None:
        """Forget the frames before, as after a jump in a recording."""
        self._follower = ContactFollower(self._recogniser, PatternExtractor(unit=self._unit), self._pitch)

    def state(self, frame: TaxelFrame, acquired: float) -> PadState:
        """Return what is seen in ``frame``, which was ``acquired`` [s, steady clock]."""
        found = self._follower.follow(frame.values, frame.stamp, saturated=frame.status == TaxelStatus.SATURATED,
                                      unmapped=frame.status == TaxelStatus.UNMAPPED)
        return PadState(self._pad, frame.stamp, acquired, frame.values, frame.status, self._pitch, self._unit,
                        self._contact(found))

    def _contact(self, found: StreamedContact) -> SeenContact:
        contact, shape = found.contact, found.fused.recognition
        moments = contact_moments(contact.values, contact.mask, self._pitch, self._unit, visibility_of(contact))
        fit = found.fit
        return SeenContact(
            shape=shape.shape.value, reason=shape.reason.name.lower() if shape.shape is Shape.UNKNOWN else '',
            probabilities={each.value: value for each, value in shape.probabilities.items()},
            outline=None if fit is None else fit.outline,
            dimensions=() if fit is None else tuple(zip(fit.dimension_names, fit.dimensions)),
            size_is_bound=fit is not None and moments.size_is_bound,
            force=moments.force if contact.mask.any() or contact.pad_seen else np.nan, mask=contact.mask,
            force_is_bound=moments.force_is_bound)
