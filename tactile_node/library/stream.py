"""Process successive frames of one pad, with hysteresis for pressed taxels and recognition fused over time."""

from pathlib import Path

from numpy.typing import ArrayLike

from tactile_node.contact.press import PressThresholds
from tactile_node.errors import InputError
from tactile_node.learning.response import SkinResponse
from tactile_node.library.contacts import (
    Recogniser,
    checked_frame,
    instance,
    known_response,
    plain,
    scale_by,
    seconds,
)
from tactile_node.pose.moments import check_pitch
from tactile_node.pose.pipeline import ContactPipeline, StreamedContact, Taxels
from tactile_node.shape.fusion import FusionSettings


class ContactStream:
    """Follows the contact on one pad, frame by frame, as the ROS nodes do.

    The stream learns the noise of each taxel while nothing presses the taxel.

    Parameters
    ----------
    recogniser : Recogniser or None
        Recogniser, which several streams may share, or None for the package's own recogniser.
    pitch : float
        Distance between neighbouring taxels, as in `fit_shape`.
    unit : str or None
        Unit of the values, as in `find_contact`. The unit is not used with ``thresholds``.
    thresholds : PressThresholds or None
        Fixed thresholds, as in `find_contact`.
    fusion : FusionSettings or None
        Settings of the fusion, or None for the default settings.
    response : str, Path or None
        File from `tactile calibrate`, or None. With a response, the frames must contain readings with their zero
        subtracted, and the curve in the file converts these readings to pressures.

    Raises
    ------
    ConfigurationError
        Raised if the unit or the pitch is invalid.
    InputError
        Raised if an argument has the wrong type.

    Examples
    --------
    >>> import numpy as np
    >>> stream, frame = ContactStream(pitch=0.004), np.pad(np.full((7, 7), 50e3), 4)
    >>> for k in range(3):
    ...     found = stream.update(frame, stamp=0.02 * k)
    >>> found.fused.recognition.shape.value, found.fused.frames, round(found.fit.dimensions[0], 3)
    ('square', 3, 0.028)
    """

    def __init__(self, recogniser: Recogniser | None = None, *, pitch: float = 1.0, unit: str | None = '',
                 thresholds: PressThresholds | None = None, fusion: FusionSettings | None = None,
                 response: str | Path | SkinResponse | None = None):
        pitch = plain(pitch)
        check_pitch(pitch)
        recogniser = Recogniser() if recogniser is None else recogniser
        fusion = FusionSettings() if fusion is None else fusion
        known, self._scale = scale_by(unit, thresholds)
        found = known_response(response, self._scale.unit)
        self._taxels = Taxels(pitch, self._scale.unit, None if found is None else found.layer)
        self._pipeline = ContactPipeline(
            instance(recogniser, Recogniser, 'recogniser', 'Pass Recogniser(method), or None.').method,
            thresholds=known, curve=None if found is None else found.curve,
            fusion=instance(fusion, FusionSettings, 'fusion', 'Pass FusionSettings(), or None.'))
        self._shape: tuple[int, ...] | None = None

    def update(self, values: ArrayLike, stamp: float, *, saturated: ArrayLike | None = None,
               unmapped: ArrayLike | None = None) -> StreamedContact:
        """Add a frame, and return the results so far.

        If the pad is not seen in a frame, the frame is reported as UNKNOWN with the reason NOT_SEEN. A frame in which
        the pad is not seen does not affect the results for other frames. The fusion starts again if the stamp goes
        backwards or jumps by more than `FusionSettings.max_gap`.

        Parameters
        ----------
        values : array_like
            Taxel values, (rows, cols).
        stamp : float
            Acquisition time of the frame [s].
        saturated, unmapped : array_like or None
            As in `find_contact`.

        Raises
        ------
        InputError
            Raised if the array is invalid, its shape has changed, or the stamp is not a finite number.
        """
        stamp = seconds(stamp)
        frame = checked_frame(values, self._scale)
        self._check_shape(frame.shape)
        return self._pipeline.follow(frame, self._taxels, stamp, saturated=saturated, unmapped=unmapped)

    def _check_shape(self, shape: tuple[int, ...]) -> None:
        if self._shape is None:
            self._shape = shape
        if shape != self._shape:
            raise InputError('taxel frame of a stream', expected=f'shape {self._shape}, as before', got=f'{shape}',
                             remedy='Create one ContactStream for each pad.')
