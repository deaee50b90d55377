"""Successive frames of one pad: hysteresis of what is pressed, and a recognition fused over time."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.errors import InputError
from tactile_node.learning.response import SkinResponse
from tactile_node.library.contacts import (
    Recogniser,
    checked_frame,
    extractor_by,
    fit_shape,
    instance,
    known_response,
    recognised,
    seconds,
)
from tactile_node.pose.fit import ShapeFit
from tactile_node.pose.moments import check_pitch
from tactile_node.shape.recognition import Recognition
from tactile_node.shape.recognitions import FusedRecognition, FusionSettings, RecognitionFusion


class StreamedContact(NamedTuple):
    """The results for one frame, and for all frames of the contact up to it."""

    contact: ContactPattern   #: as recognised: the largest contact with the pieces of it that are torn off
    recognition: Recognition  #: of this frame alone
    fused: FusedRecognition   #: of all frames since the contact began
    fit: ShapeFit | None      #: of the fused shape; None while nothing with an outline touches


class ContactFollower:
    """Frame -> contact -> recognition -> fused shape -> fit, without checks: of a pad whose unit and size are known.

    ``response``: frames are readings that its curve turns into pressures.
    """

    def __init__(self, recogniser: Recogniser, extractor: PatternExtractor, pitch: float,
                 fusion: FusionSettings | None = None, response: SkinResponse | None = None):
        self._recogniser, self._extractor = recogniser, extractor
        self._pitch, self._response = pitch, response
        self._fusion = RecognitionFusion() if fusion is None else RecognitionFusion(fusion)

    def follow(self, frame: np.ndarray, stamp: float, *, saturated: ArrayLike | None = None,
               unmapped: ArrayLike | None = None) -> StreamedContact:
        """Take ``frame``, (rows, cols), of time ``stamp`` [s]."""
        if self._response is not None and frame.dtype != bool:
            frame = self._response.curve(frame.astype(float))
        contact, recognition = recognised(
            self._recogniser, self._extractor.extract(frame, saturated=saturated, unmapped=unmapped))
        fused = self._fusion.update(stamp, recognition)
        touches = bool(contact.mask.any())
        fit = fit_shape(contact, fused.recognition.shape, self._pitch, self._response) if touches else None
        return StreamedContact(contact, recognition, fused, fit)


class ContactStream:
    """Follows the contact on one pad, frame by frame, as the ROS nodes do.

    ``recogniser``: one that several streams share; None: the package's own. ``pitch``, ``unit`` and ``thresholds`` as
    in `find_contact` and `fit_shape`; with ``thresholds``, ``unit`` counts for nothing. The noise of each taxel is
    learned while nothing presses it. ``fusion``: other constants of the fusion. ``response``: file of
    `tactile calibrate`; frames are then readings, less their zero, that its curve turns into pressures.

    >>> import numpy as np
    >>> stream, frame = ContactStream(pitch=0.004), np.pad(np.full((7, 7), 50e3), 4)
    >>> for k in range(3):
    ...     found = stream.update(frame, stamp=0.02 * k)
    >>> found.fused.recognition.shape.value, found.fused.frames, round(found.fit.dimensions[0], 3)
    ('square', 3, 0.028)

    Raises ConfigurationError for another unit or pitch, InputError for an argument of another type.
    """

    def __init__(self, recogniser: Recogniser | None = None, *, pitch: float = 1.0, unit: str | None = '',
                 thresholds: PressThresholds | None = None, fusion: FusionSettings | None = None,
                 response: str | Path | SkinResponse | None = None):
        check_pitch(pitch)
        recogniser = Recogniser() if recogniser is None else recogniser
        fusion = FusionSettings() if fusion is None else fusion
        extractor, self._scale = extractor_by(unit, thresholds)
        self._follower = ContactFollower(
            instance(recogniser, Recogniser, 'recogniser', 'Pass Recogniser(method), or None.'), extractor, pitch,
            instance(fusion, FusionSettings, 'fusion', 'Pass FusionSettings(), or None.'),
            known_response(response, self._scale.unit))
        self._shape: tuple[int, ...] | None = None

    def update(self, values: ArrayLike, stamp: float, *, saturated: ArrayLike | None = None,
               unmapped: ArrayLike | None = None) -> StreamedContact:
        """Take the frame ``values``, shape (rows, cols), of time ``stamp`` [s], and return the results so far.

        Hidden, ``saturated`` and ``unmapped`` taxels as in `find_contact`. A frame in which the pad is not seen is
        reported as UNKNOWN, not seen, and changes nothing in what the frames before and after it say of the contact.
        Stamps that go back or leave out more than `FusionSettings.max_gap` start the fusion again. Raises InputError
        for another array, one of another shape than before, and a stamp that is no time.
        """
        stamp = seconds(stamp)
        frame = checked_frame(values, self._scale)
        self._check_shape(frame.shape)
        return self._follower.follow(frame, stamp, saturated=saturated, unmapped=unmapped)

    def _check_shape(self, shape: tuple[int, ...]) -> None:
        if self._shape is None:
            self._shape = shape
        if shape != self._shape:
            raise InputError('taxel frame of a stream', expected=f'shape {self._shape}, as before', got=f'{shape}',
                             remedy='Make a ContactStream for each pad.')
