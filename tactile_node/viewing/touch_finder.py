"""Find the touches in the taxel frames of one pad.

A touch is a run of taxel frames with a contact of at least SMALLEST_CONTACT taxels. Frames with a smaller contact are
only counted, because noise on single taxels looks the same. A touch ends in one of these cases:

- A frame shows the whole pad without a contact of this size.
- A frame without a contact of this size shows at least the fraction RELEASED of the previously pressed taxels.
- No taxel frame arrives for longer than MAX_PAUSE.

A frame that hides the previously pressed taxels neither begins nor ends a touch. The finder searches every frame for a
contact, but recognises a shape only once every RECOGNITION_PERIOD. The ROS nodes recognise as many frames as they can,
but a report on a recording of several hours must not take hours.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from tactile_node.contact.press import SMALLEST_CONTACT
from tactile_node.pose.events import Event
from tactile_node.pose.pipeline import ContactPipeline, FoundContact, Taxels
from tactile_node.shape.methods import VisibilityGuard
from tactile_node.shape.recognition import Shape, ShapeClass, UnknownReason
from tactile_node.taxel_frame import TaxelFrame
from tactile_node.viewing.pad_recogniser import seen_contact, taxel_masks
from tactile_node.viewing.states import PadState
from tactile_node.viewing.touch import MOST_TOUCHES, ReportedTouch, Sample, TouchList

#: time between two shape recognitions in a touch [s]; at this period, recognition takes as long as the rest of a report
RECOGNITION_PERIOD = 0.1
#: visible fraction of the last pressed taxels that ends a touch; a pad with a missing row is never fully visible
RELEASED = 0.5
MAX_PAUSE = 0.5  #: time without a taxel frame after which the next contact counts as a new touch [s]


class ReportedTouchFinder:
    """Finds the touches on one pad.

    Parameters
    ----------
    pad
        Name of the pad.
    pitch
        Distance between neighbouring taxels [m].
    unit
        Unit of the values.
    recogniser
        Shape recogniser, which several finders may share.
    """

    def __init__(self, pad: str, pitch: float, unit: str, recogniser: VisibilityGuard):
        self._pad, self._taxels = pad, Taxels(pitch, unit)
        self._pipeline = ContactPipeline(recogniser, fits=False)
        self._touch: _OpenTouch | None = None
        self._last: float | None = None  # stamp of the last frame
        self.found = TouchList()
        self.samples: list[Sample] = []

    def feed(self, frame: TaxelFrame) -> None:
        if self._last is not None and not 0 <= frame.stamp - self._last <= MAX_PAUSE:
            self._end(is_open=False)
        self._last = frame.stamp
        found = self._pipeline.find(frame.values, self._taxels, **taxel_masks(frame))
        pattern = found.pattern
        taxels = np.count_nonzero(pattern.mask)
        if taxels >= SMALLEST_CONTACT:
            if self._touch is None:
                self._pipeline.restart()
                self._touch = _OpenTouch(self._pad, self._pipeline)
            self._touch.feed(frame, found)
            return
        self.found.small_frames += bool(taxels)
        if self._touch is not None and (found.visibility.pad_seen or self._touch.shown(~pattern.hidden) >= RELEASED):
            self._end(is_open=False)

    def end(self) -> None:
        """End the current touch at the end of the recording."""
        self._end(is_open=True)
        self.found.keep_pictures()

    def _end(self, is_open: bool) -> None:
        touch, self._touch = self._touch, None
        if touch is None:
            return
        self.samples += touch.samples
        if len(self.found) == MOST_TOUCHES:
            self.found.left_out += 1
        else:
            self.found.append(touch.closed(is_open))


class _OpenTouch:
    """The touch that has not yet ended."""

    def __init__(self, pad: str, pipeline: ContactPipeline):
        self._pad, self._pipeline = pad, pipeline
        self._begin = self._end = 0.0
        self._frames = 0
        self._most = -np.inf  # largest sum of the contact's values
        self._strongest: tuple[TaxelFrame, FoundContact] | None = None  # the frame with this sum
        self._last = np.zeros(0, bool)  # taxels pressed in the last frame
        self._reasons: Counter[UnknownReason] = Counter()
        self.samples: list[Sample] = []
        self._events: list[Event] = []

    def shown(self, seen: np.ndarray) -> float:
        """Return the visible fraction of the last pressed taxels, given the mask ``seen``, bool (rows, cols)."""
        return float(seen[self._last].mean())

    def feed(self, frame: TaxelFrame, found: FoundContact) -> None:
        pattern = found.pattern
        self._last = pattern.mask
        if not self._frames:
            self._begin = frame.stamp
        self._end = frame.stamp
        self._frames += 1
        pressed = float(np.nansum(pattern.values, where=pattern.mask))
        if pressed > self._most:
            self._most, self._strongest = pressed, (frame, found)
        if not self.samples or frame.stamp - self.samples[-1].stamp >= RECOGNITION_PERIOD:
            self._recognise(frame.stamp, found)

    def closed(self, is_open: bool) -> ReportedTouch:
        assert self._strongest is not None
        shape = _most_frequent([sample.shape for sample in self.samples])
        confidence = float(np.median([sample.confidence for sample in self.samples if sample.shape == shape]))
        frame, strongest = self._strongest
        found, _ = self._pipeline.recognise_alone(strongest)
        reason = self._reasons.most_common(1)[0][0] if shape is Shape.UNKNOWN else UnknownReason.NOT_UNKNOWN
        contact = seen_contact(shape, reason, {shape.value: confidence}, found.pattern.mask, found.fit(shape),
                               found.moments)
        taxels = found.taxels
        picture = PadState(self._pad, frame.stamp, frame.stamp, frame.values, frame.status, taxels.pitch,
                           taxels.unit or '', contact)
        return ReportedTouch(self._begin, self._end, self._frames, is_open, contact, picture, tuple(self._events))

    def _recognise(self, stamp: float, found: FoundContact) -> None:
        result = self._pipeline.recognise(found, stamp)
        fused = result.fused.recognition
        self._events += result.motion.events
        if fused.shape is Shape.UNKNOWN:
            self._reasons[fused.reason] += 1
        self.samples.append(Sample(stamp, fused.shape, fused.confidence, result.moments.force))


def _most_frequent(shapes: Sequence[ShapeClass]) -> ShapeClass:
    """Return the most frequent class. A tie goes to a shape, because every touch begins and ends as "unknown".

    >>> _most_frequent([Shape.UNKNOWN, Shape.UNKNOWN, Shape.UNKNOWN, Shape.SQUARE, Shape.SQUARE]).value
    'unknown'
    >>> _most_frequent([Shape.UNKNOWN, Shape.SQUARE]).value
    'square'
    """
    counts = Counter(shape for shape in shapes if shape is not Shape.NONE) or Counter([Shape.UNKNOWN])
    return max(counts, key=lambda shape: (counts[shape], shape is not Shape.UNKNOWN))
