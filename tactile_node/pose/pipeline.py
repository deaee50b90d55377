"""Process taxel frames into a contact, its visibility, its shape fused over time, its fit, its moments and its box.

The nodes, `tactile classify`, the report, the view, teaching, calibration and the library all use this pipeline. The
processor node runs the first half (`ContactPipeline.find`), and the classifier node runs the second half
(`ContactPipeline.recognise`).
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from tactile_node.contact.neighbours import grown
from tactile_node.contact.pattern import MOST_LABELS, ContactPattern, PatternExtractor, of_contact
from tactile_node.contact.press import SMALLEST_CONTACT, PressThresholds
from tactile_node.contact.visibility import Visibility, visibility_of
from tactile_node.pose.box import ContactBox, contact_box
from tactile_node.pose.events import Motion
from tactile_node.pose.fit import ShapeFit, fit_contact
from tactile_node.pose.moments import ContactMoments, contact_moments, force_of_reading, sum_of
from tactile_node.pose.motion import SHIFT_PER_LOAD, MotionFollower, Sight
from tactile_node.pose.outline_fit import OutlineFit
from tactile_node.pose.profiles import Layer
from tactile_node.shape.fusion import FusedRecognition, FusionSettings, RecognitionFusion
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from tactile_node.shape.patch import join_pieces
from tactile_node.shape.recognition import Recognition, Shape, ShapeClass
from tactile_node.taxel_frame import NO_SIDE, ON_OFF_UNIT, SkinSide

DEFAULT_FUSION = FusionSettings()
#: Longest time for which a recognition is reused for frames with the same pressed taxels [s]. With simulated contacts
#: (validation seeds) and a noise of 2 or 5 % of the largest value, the fused shapes after 3, 6 and 12 frames at 50 Hz
#: were as often right and as often sure as without reuse.
REUSE_TIME = 0.08


class Curve(Protocol):
    """A function that converts readings into pressures."""

    def __call__(self, values: np.ndarray) -> np.ndarray: ...


class Taxels(NamedTuple):
    """The properties of a pad's taxels that do not depend on their readings."""

    pitch: float = 1.0               #: distance between neighbouring taxels; all lengths have the same unit
    unit: str | None = None          #: unit of the values: 'Pa', 'N' or '1' (on/off); '' or None if the unit is unknown
    layer: Layer | None = None       #: layer of a calibrated skin

    #: sides on which the finger ends at the edge of the skin; elsewhere the finger continues
    finger_ends: SkinSide = NO_SIDE


class FoundContact(NamedTuple):
    """The contacts of one frame, and how much of the pad the frame shows."""

    pattern: ContactPattern
    visibility: Visibility  #: visibility of ``pattern``
    taxels: Taxels
    #: size of the smallest reported contact [taxels]. The pad is not seen while hidden taxels could hold a contact of
    #: this size.
    smallest_contact: int = SMALLEST_CONTACT

    @classmethod
    def of(cls, pattern: ContactPattern, taxels: Taxels, smallest_contact: int = SMALLEST_CONTACT) -> 'FoundContact':
        """Return the contact of ``pattern`` together with its visibility."""
        visibility = visibility_of(pattern, smallest_contact, taxels.finger_ends)
        return cls(pattern, visibility, taxels, smallest_contact)

    def of_pattern(self, pattern: ContactPattern) -> 'FoundContact':
        """Return the contact of another pattern of the same frame.

        The result keeps ``pad_seen``, because that value belongs to the whole frame.
        """
        seen = self.of(pattern, self.taxels, self.smallest_contact).visibility
        return self._replace(pattern=pattern, visibility=seen._replace(pad_seen=self.visibility.pad_seen))

    def fit(self, shape: ShapeClass, outlines: dict[Shape, OutlineFit] | None = None,
            stamp: float = 0.0) -> ShapeFit | None:
        """Return the pose and size of the contact, or None if there is no contact or the shape has no outline.

        Parameters
        ----------
        shape, outlines, stamp
            As for `fit_shape`.
        """
        if not np.count_nonzero(self.pattern.mask):
            return None
        return fit_contact(self.pattern, shape, self.taxels.pitch, self.taxels.layer, self.visibility,
                           outlines, stamp)

    @property
    def moments(self) -> ContactMoments:
        """Force, centre of pressure and area of the contact. The force is NaN for values without a unit."""
        return contact_moments(self.pattern.values, self.pattern.mask, self.taxels.pitch,
                               self.taxels.unit or ON_OFF_UNIT, self.visibility, self.pattern.noise)

    def pad_force(self, moments: ContactMoments) -> tuple[float, bool]:
        """Return the force of all contacts on the pad, given the ``moments`` of this contact.

        For every contact except this one, a single hidden taxel in or beside the contact makes the total a bound,
        because no standard deviation accounts for that taxel.

        Returns
        -------
        force : float
            Force [N]; NaN if the force of this contact is NaN.
        is_bound : bool
            True if the force is a lower bound, because the force of a contact is a bound or hidden taxels could hold
            another contact.
        """
        pattern, taxels = self.pattern, self.taxels
        others = (pattern.labels > 0) & ~pattern.mask
        is_bound = moments.force_is_bound or not self.visibility.pad_seen
        if not np.count_nonzero(others):
            return moments.force, is_bound
        seen = visibility_of(pattern._replace(mask=others), 1, taxels.finger_ends)
        total = sum_of(pattern.values, grown(others) & ~grown(pattern.mask))
        is_bound = is_bound or seen.is_part or pattern.contacts > MOST_LABELS
        return moments.force + total * force_of_reading(taxels.unit or ON_OFF_UNIT, taxels.pitch), is_bound

    @property
    def box(self) -> ContactBox:
        """The smallest rectangle around the contact."""
        return contact_box(self.pattern, self.taxels.pitch, self.visibility)


class StreamedContact(NamedTuple):
    """The results for one frame, and the recognition over all frames since its contact began."""

    recognition: Recognition  #: recognition of this frame alone, or of a recent frame with the same taxels
    fused: FusedRecognition   #: recognition over all frames since the contact began
    fit: ShapeFit | None      #: fit of the fused shape, or None if the shape has no outline
    found: FoundContact       #: the recognised contact: the largest contact, together with the pieces joined to it
    moments: ContactMoments   #: moments of the recognised contact
    motion: Motion  #: movement of the contact, which is unknown if the pipeline recognises each frame separately


class _Answer(NamedTuple):
    """The recognition of one frame, and the recognised contact."""

    found: FoundContact
    stamp: float
    recognition: Recognition

    def holds_for(self, found: FoundContact, stamp: float) -> bool:
        """Return True if a later frame is too soon and too similar to add much information."""
        pattern, before = found.pattern, self.found.pattern
        return (0 <= stamp - self.stamp < REUSE_TIME and found.visibility == self.found.visibility
                and np.array_equal(pattern.labels, before.labels) and np.array_equal(pattern.hidden, before.hidden))


class ContactPipeline:
    """Follows the contact on one pad, frame by frame.

    With ``fusion``, a recognition is reused for later frames with the same pressed taxels, until REUSE_TIME has passed.
    Frames with the same pressed taxels have mostly the same errors, so a new recognition would take time and add
    little.

    Parameters
    ----------
    recogniser : VisibilityGuard or None
        Recogniser, which several pads may share, or None for the package's own recogniser. The package's own recogniser
        is loaded on first use.
    thresholds : PressThresholds or None
        Fixed press thresholds, or None to derive the thresholds from the noise.
    smallest_contact : int
        Size of the smallest reported contact [taxels].
    curve : Curve or None
        Function that turns readings into pressures.
    fusion : FusionSettings or None
        Settings of the fusion, or None to recognise each frame separately.
    fits : bool
        False to skip the fit of pose and size.
    shift_per_load : float
        Largest shift of a contact that sticks, divided by the load along the pad as a share of the normal force [m].
    """

    def __init__(self, recogniser: VisibilityGuard | None = None, *, thresholds: PressThresholds | None = None,
                 smallest_contact: int = SMALLEST_CONTACT, curve: Curve | None = None,
                 fusion: FusionSettings | None = DEFAULT_FUSION, fits: bool = True,
                 shift_per_load: float = SHIFT_PER_LOAD):
        self._recogniser = recogniser
        self._thresholds, self._smallest_contact, self._curve = thresholds, smallest_contact, curve
        self._extractors: dict[str | None, PatternExtractor] = {}  # one extractor for each unit of values
        self._fusion = None if fusion is None else RecognitionFusion(fusion)
        self._answer: _Answer | None = None  # latest recognition of a frame
        self._fits = fits
        self._outlines: dict[Shape, OutlineFit] = {}  # fits to the present contact
        self._motion = MotionFollower(shift_per_load)

    def set_contact_limits(self, thresholds: PressThresholds | None, smallest_contact: int) -> None:
        """Apply new limits from the next frame on.

        The noise floor and the record of left-over taxels are kept.
        """
        self._smallest_contact = smallest_contact
        if thresholds != self._thresholds:
            self._thresholds = thresholds
            for extractor in self._extractors.values():
                extractor.set_thresholds(thresholds)

    def find(self, values: np.ndarray, taxels: Taxels, *, saturated: ArrayLike | None = None,
             unmapped: ArrayLike | None = None) -> FoundContact:
        """Return the contacts of the next frame, and how much of the pad the frame shows.

        Parameters
        ----------
        values : np.ndarray
            Taxel values, (rows, cols).
        taxels : Taxels
            Properties of the taxels.
        saturated : array_like or None
            True for each taxel at the end of its range, bool (rows, cols).
        unmapped : array_like or None
            True for each cell without a taxel, bool (rows, cols).
        """
        if self._curve is not None and values.dtype != bool:
            values = self._curve(values.astype(float))
        unit = taxels.unit or None
        if unit not in self._extractors:
            self._extractors[unit] = PatternExtractor(self._thresholds, unit=unit)
        pattern = self._extractors[unit].extract(values, saturated=saturated, unmapped=unmapped)
        return FoundContact.of(pattern, taxels, self._smallest_contact)

    def recognise(self, found: FoundContact, stamp: float) -> StreamedContact:
        """Recognise the shape of a contact, and fuse the result with earlier frames.

        Parameters
        ----------
        found : FoundContact
            Contact of the frame, from `find`.
        stamp : float
            Acquisition time of the frame [s].
        """
        if self._fusion is None or self._answer is None or not self._answer.holds_for(found, stamp):
            self._answer = _Answer(found, stamp, self._method.recognise(found.pattern, visibility=found.visibility))
        found, alone = _with_pieces(found, self._answer.recognition)
        fused = _unfused(alone, stamp) if self._fusion is None else self._fusion.update(stamp, alone)
        if fused.frames == 1:
            self._outlines.clear()
        if self._fusion is None:
            return self._described(found, alone, fused)
        result = self._described(found, alone, fused, self._outlines, stamp)
        return result._replace(motion=self._motion.update(sight_of(result, stamp)))

    def follow(self, values: np.ndarray, taxels: Taxels, stamp: float, *, saturated: ArrayLike | None = None,
               unmapped: ArrayLike | None = None) -> StreamedContact:
        """Return the results for the next frame: `find`, then `recognise`."""
        return self.recognise(self.find(values, taxels, saturated=saturated, unmapped=unmapped), stamp)

    def recognise_alone(self, found: FoundContact) -> tuple[FoundContact, Recognition]:
        """Recognise a contact from its frame alone.

        Earlier frames do not affect the result, and the result does not affect later frames.

        Returns
        -------
        found : FoundContact
            The recognised contact, together with the pieces joined to it.
        recognition : Recognition
            Its recognition.
        """
        return _with_pieces(found, self._method.recognise(found.pattern, visibility=found.visibility))

    def recognise_each(self, largest: StreamedContact, stamp: float, most: int) -> list[StreamedContact]:
        """Return the results for each of the largest contacts, from this frame alone.

        Parameters
        ----------
        largest : StreamedContact
            Result for the largest contact of the frame.
        stamp : float
            Acquisition time of the frame [s].
        most : int
            Largest number of contacts to recognise.
        """
        results = []
        pattern = largest.found.pattern
        for number in range(1, min(pattern.contacts, most) + 1):
            found, alone = largest.found.of_pattern(of_contact(pattern, number)), largest.recognition
            if number > 1:  # pieces are joined only to the largest contact, to which they may belong
                alone = self._method.recognise(found.pattern._replace(contacts=1), visibility=found.visibility)
            results.append(self._described(found, alone, _unfused(alone, stamp)))
        return results

    def restart(self) -> None:
        """Forget the shape recognised in earlier frames.

        Call this method when you know that the pad touches another object.
        """
        self._outlines.clear()
        self._motion.restart()
        self._answer = None
        if self._fusion is not None:
            self._fusion.reset()

    @property
    def _method(self) -> VisibilityGuard:
        if self._recogniser is None:
            self._recogniser = make_recogniser()
        return self._recogniser

    def _described(self, found: FoundContact, alone: Recognition, fused: FusedRecognition,
                   outlines: dict[Shape, OutlineFit] | None = None, stamp: float = 0.0) -> StreamedContact:
        fit = found.fit(fused.recognition.shape, outlines, stamp) if self._fits else None
        return StreamedContact(alone, fused, fit, found, found.moments, Motion())


def _with_pieces(found: FoundContact, alone: Recognition) -> tuple[FoundContact, Recognition]:
    """Return the contact that ``alone`` describes, including any pieces joined to it, and ``alone`` itself."""
    return (found.of_pattern(join_pieces(found.pattern)) if alone.joined else found), alone


def sight_of(result: StreamedContact, stamp: float) -> Sight:
    """Return the measurements of a frame with which `MotionFollower` follows the contact."""
    found, none = result.found, result.recognition.probabilities.get(Shape.NONE, 0.0)
    return Sight(stamp, found.pattern, found.visibility, result.moments, result.fit, none, found.taxels.pitch,
                 (found.taxels.unit or ON_OFF_UNIT) == ON_OFF_UNIT)


def _unfused(alone: Recognition, stamp: float) -> FusedRecognition:
    return FusedRecognition(alone, stamp, 0.0, 1)
