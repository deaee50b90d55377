"""Recognise the contact on a pad, and describe it in the form that all views and the report share."""

from collections.abc import Mapping

import numpy as np

from tactile_node.pose.events import EventKind
from tactile_node.pose.fit import ShapeFit
from tactile_node.pose.moments import ContactMoments
from tactile_node.pose.pipeline import ContactPipeline, StreamedContact, Taxels
from tactile_node.shape.methods import VisibilityGuard
from tactile_node.shape.recognition import Shape, ShapeClass, UnknownReason
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus
from tactile_node.viewing.states import PadState, SeenContact, moving_words


class PadRecogniser:
    """Recognises the contact on one pad, frame by frame. Several pads may share one ``recogniser``."""

    def __init__(self, pad: str, pitch: float, unit: str, recogniser: VisibilityGuard):
        self._pad, self._taxels, self._recogniser = pad, Taxels(pitch, unit), recogniser
        self.restart()

    def restart(self) -> None:
        """Forget the previous frames, for example after a jump in a recording."""
        self._pipeline = ContactPipeline(self._recogniser)

    def state(self, frame: TaxelFrame, acquired: float) -> PadState:
        """Return the state of the pad in ``frame``.

        Parameters
        ----------
        frame
            Taxel frame of the pad.
        acquired
            Acquisition time of the frame on the steady clock [s].
        """
        result = self._pipeline.follow(frame.values, self._taxels, frame.stamp, **taxel_masks(frame))
        return PadState(self._pad, frame.stamp, acquired, frame.values, frame.status, self._taxels.pitch,
                        self._taxels.unit or '', _streamed(result, frame.stamp))


def taxel_masks(frame: TaxelFrame) -> dict[str, np.ndarray]:
    """Return masks of the saturated and the unmapped taxels in ``frame``."""
    return {'saturated': frame.status == TaxelStatus.SATURATED, 'unmapped': frame.status == TaxelStatus.UNMAPPED}


def seen_contact(shape: ShapeClass, reason: UnknownReason, probabilities: Mapping[str, float], mask: np.ndarray,
                 fit: ShapeFit | None, moments: ContactMoments) -> SeenContact:
    """Return the description of a contact with a recognised ``shape``.

    Parameters
    ----------
    shape, reason
        Recognised shape, and the reason if the shape is unknown.
    probabilities
        Probabilities by name of the shape.
    mask
        Taxels of the contact, bool (rows, cols).
    fit
        Fitted outline, or None if there is none.
    moments
        Force and bounds of the contact.
    """
    return SeenContact(
        shape=shape.value, reason=reason.name.lower() if shape is Shape.UNKNOWN else '', probabilities=probabilities,
        outline=None if fit is None else fit.outline,
        dimensions=() if fit is None else tuple(zip(fit.dimension_names, fit.dimensions)),
        size_is_bound=fit is not None and moments.size_is_bound, force=moments.force, mask=mask,
        force_is_bound=moments.force_is_bound)


def _streamed(result: StreamedContact, stamp: float) -> SeenContact:
    contact, recognition, motion = result.found.pattern, result.fused.recognition, result.motion
    seen = seen_contact(recognition.shape, recognition.reason,
                        {each.value: value for each, value in recognition.probabilities.items()}, contact.mask,
                        result.fit, result.moments)
    event = motion.last_event
    moves = moving_words(motion.moving, motion.speed, motion.rate, event.kind if event else EventKind.NOT_KNOWN,
                         stamp - event.stamp if event else np.inf)
    is_force_known = contact.mask.any() or result.found.visibility.pad_seen
    return seen._replace(moves=moves, force=seen.force if is_force_known else np.nan)
