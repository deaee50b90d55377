"""Successive frames of one pad: hysteresis of what is pressed, and a belief that grows surer with time."""

from typing import NamedTuple

import numpy as np

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.fusion.recognitions import FusedRecognition, FusionSettings, RecognitionFusion
from tactile_node.library.contacts import Recogniser, default_thresholds, fit_shape
from tactile_node.pose.fit import ShapeFit
from tactile_node.shape.recognition import Recognition


class StreamedContact(NamedTuple):
    """What one frame, and all frames of the contact up to it, say."""

    contact: ContactPattern
    recognition: Recognition  #: of this frame alone
    fused: FusedRecognition   #: of all frames since the contact began
    fit: ShapeFit | None      #: of the fused shape; None while nothing with an outline touches


class ContactStream:
    """Follows the contact on one pad, frame by frame, as the ROS nodes do.

    ``recogniser``: one that several streams share; None: the package's own. ``pitch``, ``unit`` and ``thresholds`` as
    in `fit_shape` and `find_contact`; without a unit, the first frame sets the full scale.

    >>> import numpy as np
    >>> stream, frame = ContactStream(pitch=0.004), np.pad(np.full((7, 7), 50e3), 4)
    >>> for k in range(3):
    ...     found = stream.update(frame, stamp=0.02 * k)
    >>> found.fused.recognition.shape.value, found.fused.frames, round(found.fit.dimensions[0], 3)
    ('square', 3, 0.028)
    """

    def __init__(self, recogniser: Recogniser | None = None, *, pitch: float = 1.0, unit: str | None = 'Pa',
                 thresholds: PressThresholds | None = None, fusion: FusionSettings | None = None):
        self._recogniser = recogniser or Recogniser()
        self._pitch = pitch
        self._unit = unit
        self._thresholds = thresholds
        self._extractor: PatternExtractor | None = None
        self._fusion = RecognitionFusion(fusion or FusionSettings())

    def update(self, values: np.ndarray, stamp: float) -> StreamedContact:
        """Take the frame ``values``, shape (rows, cols), of time ``stamp`` [s]. Raises InputError for another array."""
        if self._extractor is None:
            self._extractor = PatternExtractor(self._thresholds or default_thresholds(values, self._unit))
        contact = self._extractor.extract(values)
        recognition = self._recogniser.recognise(contact)
        fused = self._fusion.update(stamp, recognition.probabilities)
        touches = bool(contact.mask.any())
        fit = fit_shape(contact, fused.recognition.shape, self._pitch) if touches else None
        return StreamedContact(contact, recognition, fused, fit)
