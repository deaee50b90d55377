"""Taxel frame -> contact -> what is seen -> shape, fused over time -> fit, moments, box: the one way through the core.

The nodes, `tactile classify`, report, view, teaching, calibration and library follow it. Of the nodes the processor
does the first half (`ContactPipeline.find`) and the classifier the second (`ContactPipeline.recognise`).
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from tactile_node.contact.pattern import ContactPattern, PatternExtractor, of_contact
from tactile_node.contact.press import SMALLEST_CONTACT, PressThresholds
from tactile_node.contact.visibility import Visibility, visibility_of
from tactile_node.pose.box import ContactBox, contact_box
from tactile_node.pose.events import Motion
from tactile_node.pose.fit import Finder, FitFollower, ShapeFit, fit_contact
from tactile_node.pose.moments import ContactMoments, PadForce, contact_moments, pad_force
from tactile_node.pose.motion import MotionFollower, Sight
from tactile_node.pose.profiles import Layer
from tactile_node.shape.fusion import FusedRecognition, FusionSettings, RecognitionFusion
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from tactile_node.shape.patch import join_pieces
from tactile_node.shape.recognition import Recognition, Shape, ShapeClass, UnknownReason
from tactile_node.taxel_frame import NO_SIDE, ON_OFF_UNIT, SkinSide

DEFAULT_FUSION = FusionSettings()
SURE = 0.9  #: confidence from which a recognition counts for the frames that are like its own


class Curve(Protocol):
    """Returns pressures for readings."""

    def __call__(self, values: np.ndarray) -> np.ndarray: ...


class Taxels(NamedTuple):
    """What is known of a pad's taxels, whatever they read."""

    pitch: float = 1.0          #: distance of neighbours; all lengths come in its unit
    unit: str | None = None     #: unit of the values: 'Pa', 'N' or '1' (on/off); '' or None: not known
    layer: Layer | None = None  #: layer of a calibrated skin
    finger_ends: SkinSide = NO_SIDE  #: sides at which the finger ends with the skin; at the others it goes on


class FoundContact(NamedTuple):
    """What is pressed in one frame, and how much of the pad the frame shows."""

    pattern: ContactPattern
    visibility: Visibility  #: what is seen of ``pattern``
    taxels: Taxels
    smallest_contact: int = SMALLEST_CONTACT  #: [taxels]; a pad is not seen while hidden ones could hold it

    @classmethod
    def of(cls, pattern: ContactPattern, taxels: Taxels, smallest_contact: int = SMALLEST_CONTACT) -> 'FoundContact':
        """Return the contact of ``pattern`` with what is seen of it."""
        visibility = visibility_of(pattern, smallest_contact, taxels.finger_ends)
        return cls(pattern, visibility, taxels, smallest_contact)

    def of_pattern(self, pattern: ContactPattern) -> 'FoundContact':
        """Return the contact of another ``pattern`` of the same frame; whether the pad is seen was found before."""
        seen = self.of(pattern, self.taxels, self.smallest_contact).visibility
        return self._replace(pattern=pattern, visibility=seen._replace(pad_seen=self.visibility.pad_seen))

    def fit(self, shape: ShapeClass, find: Finder | None = None) -> ShapeFit | None:
        """Return pose and size as a ``shape``; None where that has no outline, and without a contact.

        ``find``: of a `FitFollower`; None: whatever the frames before have shown.
        """
        if not self.pattern.mask.any():
            return None
        return fit_contact(self.pattern, shape, self.taxels.pitch, self.taxels.layer, self.visibility,
                           find)

    @property
    def moments(self) -> ContactMoments:
        """Force, centre of pressure, area and axis. The force of values without a unit is not known."""
        return contact_moments(self.pattern.values, self.pattern.mask, self.taxels.pitch,
                               self.taxels.unit or ON_OFF_UNIT, self.visibility, self.pattern.noise)

    def pad_force(self, moments: ContactMoments) -> PadForce:
        """Return the force of all contacts of the pad; ``moments``: those of this one."""
        return pad_force(moments, self.pattern, self.taxels.pitch, self.taxels.unit or ON_OFF_UNIT, self.visibility,
                         self.taxels.finger_ends)

    @property
    def box(self) -> ContactBox:
        """The least rectangle around the contact."""
        return contact_box(self.pattern, self.taxels.pitch, self.visibility)


class StreamedContact(NamedTuple):
    """The results for one frame, and for all frames of the contact up to it."""

    contact: ContactPattern   #: as recognised: the largest contact with the pieces of it that are torn off
    recognition: Recognition  #: answer of this frame alone, or of the one just before it with the same taxels
    fused: FusedRecognition   #: answer of all frames since the contact began
    fit: ShapeFit | None      #: fit of the fused shape; None while nothing with an outline touches
    found: FoundContact       #: the same contact with what is seen of it and its box
    moments: ContactMoments   #: of the same contact
    motion: Motion            #: what moves; not known where each frame is answered alone


class _Answer(NamedTuple):
    """The recognition of one frame, and what it looked at."""

    found: FoundContact
    stamp: float
    recognition: Recognition

    def holds_for(self, found: FoundContact, stamp: float, correlation_time: float) -> bool:
        """Return whether a frame of ``stamp`` is too soon after this one, and too much like it, to say more."""
        pattern, before = found.pattern, self.found.pattern
        # a name that these taxels do not support is as lasting as a sure one
        is_settled = self.recognition.confidence >= SURE or self.recognition.doubt is not UnknownReason.NOT_UNKNOWN
        return (0 <= stamp - self.stamp < correlation_time and is_settled
                and found.visibility == self.found.visibility
                and np.array_equal(pattern.labels, before.labels) and np.array_equal(pattern.hidden, before.hidden))


class ContactPipeline:
    """Follows the contact on one pad, frame by frame.

    ``recogniser`` may be shared; None: the package's own, read when it is first needed. ``thresholds`` replace what
    stands out of the noise. ``smallest_contact``: taxels of the smallest contact that is looked for. ``curve`` turns
    readings into pressures. ``fusion`` None: each frame is answered alone. ``fits`` False: without pose and size.

    A sure recognition also answers the frames after it in which the same taxels are pressed, until the correlation time
    of ``fusion`` has passed: they err together, and most of a recognition's time is saved.
    """

    def __init__(self, recogniser: VisibilityGuard | None = None, *, thresholds: PressThresholds | None = None,
                 smallest_contact: int = SMALLEST_CONTACT, curve: Curve | None = None,
                 fusion: FusionSettings | None = DEFAULT_FUSION, fits: bool = True):
        self._recogniser = recogniser
        self._thresholds, self._smallest_contact, self._curve = thresholds, smallest_contact, curve
        self._extractors: dict[str | None, PatternExtractor] = {}  # by the unit of the values
        self._fusion = None if fusion is None else RecognitionFusion(fusion)
        self._correlation_time = 0.0 if fusion is None else fusion.correlation_time
        self._answer: _Answer | None = None  # the last that the recogniser gave
        self._fits = fits
        self._follower = FitFollower()
        self._motion = MotionFollower()

    def set_contact_limits(self, thresholds: PressThresholds | None, smallest_contact: int) -> None:
        """Use these limits from the next frame on; the noise floor and the left-over taxels stay."""
        self._smallest_contact = smallest_contact
        if thresholds != self._thresholds:
            self._thresholds = thresholds
            for extractor in self._extractors.values():
                extractor.set_thresholds(thresholds)

    def find(self, values: np.ndarray, taxels: Taxels, *, saturated: ArrayLike | None = None,
             unmapped: ArrayLike | None = None) -> FoundContact:
        """Return what is pressed in the next frame, ``values`` (rows, cols), and what of the pad is seen."""
        if self._curve is not None and values.dtype != bool:
            values = self._curve(values.astype(float))
        unit = taxels.unit or None
        if unit not in self._extractors:
            self._extractors[unit] = PatternExtractor(self._thresholds, unit=unit)
        pattern = self._extractors[unit].extract(values, saturated=saturated, unmapped=unmapped)
        return FoundContact.of(pattern, taxels, self._smallest_contact)

    def recognise(self, found: FoundContact, stamp: float) -> StreamedContact:
        """Return the shape of ``found``, which was acquired at ``stamp`` [s], fused with the frames before it."""
        if self._answer is None or not self._answer.holds_for(found, stamp, self._correlation_time):
            self._answer = _Answer(found, stamp, self._method.recognise(found.pattern, visibility=found.visibility))
        found, frame = _with_pieces(found, self._answer.recognition)
        fused = _alone(frame, stamp) if self._fusion is None else self._fusion.update(stamp, frame)
        if fused.frames == 1:
            self._follower.restart()
        if self._fusion is None:
            return self._described(found, frame, fused)
        result = self._described(found, frame, fused, self._follower.at(stamp))
        return result._replace(motion=self._motion.update(_sight(result, stamp)))

    def follow(self, values: np.ndarray, taxels: Taxels, stamp: float, *, saturated: ArrayLike | None = None,
               unmapped: ArrayLike | None = None) -> StreamedContact:
        """Return the results for the next frame: both halves."""
        return self.recognise(self.find(values, taxels, saturated=saturated, unmapped=unmapped), stamp)

    def recognise_alone(self, found: FoundContact) -> tuple[FoundContact, Recognition]:
        """Return the recognition of ``found`` by its frame alone, and the contact that it is of, with torn-off pieces.

        What the frames before have shown neither counts nor changes.
        """
        return _with_pieces(found, self._method.recognise(found.pattern, visibility=found.visibility))

    def recognise_each(self, largest: StreamedContact, stamp: float, most: int) -> list[StreamedContact]:
        """Return each of the ``most`` largest contacts by this frame alone; ``largest`` is the result of the first."""
        results = []
        for number in range(1, min(largest.contact.contacts, most) + 1):
            found, frame = largest.found.of_pattern(of_contact(largest.contact, number)), largest.recognition
            if number > 1:  # others are not joined: their pieces may belong to the largest
                frame = self._method.recognise(found.pattern._replace(contacts=1), visibility=found.visibility)
            results.append(self._described(found, frame, _alone(frame, stamp)))
        return results

    def restart(self) -> None:
        """Forget what the frames before have shown of the shape, as when another object is known to be touched."""
        self._follower.restart()
        self._motion.restart()
        self._answer = None
        if self._fusion is not None:
            self._fusion.reset()

    @property
    def _method(self) -> VisibilityGuard:
        if self._recogniser is None:
            self._recogniser = make_recogniser()
        return self._recogniser

    def _described(self, found: FoundContact, frame: Recognition, fused: FusedRecognition,
                   find: Finder | None = None) -> StreamedContact:
        fit = found.fit(fused.recognition.shape, find) if self._fits else None
        return StreamedContact(found.pattern, frame, fused, fit, found, found.moments, Motion())


def _with_pieces(found: FoundContact, frame: Recognition) -> tuple[FoundContact, Recognition]:
    """Return the contact that ``frame`` is the recognition of, with the pieces of it that are torn off."""
    return (found.of_pattern(join_pieces(found.pattern)) if frame.joined else found), frame


def _sight(result: StreamedContact, stamp: float) -> Sight:
    found, none = result.found, result.recognition.probabilities.get(Shape.NONE, 0.0)
    return Sight(stamp, found.pattern, found.visibility, result.moments, result.fit, none, found.taxels.pitch,
                 (found.taxels.unit or ON_OFF_UNIT) == ON_OFF_UNIT)


def _alone(frame: Recognition, stamp: float) -> FusedRecognition:
    return FusedRecognition(frame, stamp, 0.0, 1)
