"""Apply all corrections to the frames of one pad before other code uses them."""

from typing import NamedTuple

import numpy as np

from tactile_node.conditioning.gain import ResponseCurve
from tactile_node.conditioning.tared_pad import TaredPad, ZeroState
from tactile_node.conditioning.taxel_faults import FaultDetector, FaultyTaxels, TaxelFault
from tactile_node.errors import HalfZeroedError
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus, read_only


class PadCondition(NamedTuple):
    """Condition of a pad, such as its faulty taxels and its zero."""

    faults: FaultyTaxels
    unchanged: float = 0.0  #: time during which no taxel has changed its value [s]
    is_frozen: bool = False
    zero: ZeroState = ZeroState.VALID          #: state of the zero; values are valid only in the state VALID
    zero_error: HalfZeroedError | None = None  #: error of a device that has zeroed only some of its channels
    other_publishers: tuple[str, ...] = ()     #: full names of other nodes that also publish the taxels of this pad
    is_mirrored: bool = False  #: True if the driver counts the columns in the other direction than the layout file


class ConditionedPad:
    """Masks faulty taxels, subtracts the zero, and applies the gains and the curve, in this order.

    The published value is curve(gain x (reading - zero)), or NaN for a faulty taxel.

    If no reading of a pad changes at all for ``frozen_after`` [s], the pad has stopped sampling. While the pad is
    frozen, no value is valid, and all taxels are STALE. Use this check only for skins whose readings always fluctuate.
    A value of 0 turns the check off.

    Parameters
    ----------
    tared : TaredPad
        Subtracts the zero.
    detector : FaultDetector
        Detector that finds further faulty taxels. The taxels that it finds are reported, and with ``masks`` they are
        also removed.
    known : FaultyTaxels
        Faulty taxels that are removed from the first frame onwards.
    gains : np.ndarray or None
        Gain of each taxel, (rows, cols).
    curve : ResponseCurve or None
        Curve from readings to pressures.
    """

    def __init__(self, tared: TaredPad, detector: FaultDetector, known: FaultyTaxels, gains: np.ndarray | None = None,
                 curve: ResponseCurve | None = None):
        self.tared = tared
        self.detector = detector
        self.masks = False
        self.frozen_after = 0.0
        self.unchanged = 0.0
        self._stamp = np.inf
        self._known = known
        self.gains = gains
        self._curve = curve
        self.faults = known  #: faulty taxels known in advance, and those found by the detector
        self._detected: FaultyTaxels | None = None
        self._status = np.zeros_like(known.kinds)

    @property
    def condition(self) -> PadCondition:
        zero = self.tared.zero_state
        error = self.tared.zero_error if zero is ZeroState.DEVICE_PARTLY_ZEROED else None
        return PadCondition(faults=self.faults, unchanged=self.unchanged, is_frozen=self.is_frozen, zero=zero,
                            zero_error=error)

    @property
    def is_frozen(self) -> bool:
        return 0 < self.frozen_after <= self.unchanged

    def feed(self, frame: TaxelFrame) -> TaxelFrame:
        """Return the conditioned frame."""
        offset = self.tared.offset  # read once, because a tare may replace it meanwhile
        zero = 0.0 if offset is None else offset
        detected = self.detector.update(frame.stamp, frame.values, zero, frame.status == TaxelStatus.SATURATED.value)
        if detected is not self._detected:
            self._detected = detected
            self._combine(detected)
        self._count_unchanged(frame)
        faulty = self._status != 0 if self.masks else self._known.kinds != 0
        if np.count_nonzero(faulty):
            frame = frame.without(faulty, self._status)
        if self.is_frozen:
            frame = frame.without(frame.has_value)
        frame = self.tared.feed(frame)
        if self.gains is not None:
            frame = frame._replace(values=read_only(frame.values * self.gains))
        if self._curve is not None:
            frame = frame._replace(values=read_only(self._curve(frame.values)))
        return frame

    def _count_unchanged(self, frame: TaxelFrame) -> None:
        """Add the time since the previous frame if this frame has readings. Restart at 0 if the stamp goes
        backwards."""
        step, self._stamp = frame.stamp - self._stamp, frame.stamp
        if self.detector.has_changed or step < 0:
            self.unchanged = 0.0
        elif step < 2.0 and np.isfinite(frame.values).any():
            self.unchanged += step

    def _combine(self, detected: FaultyTaxels) -> None:
        kinds = np.where(self._known.kinds != 0, self._known.kinds, detected.kinds)
        self.faults = FaultyTaxels(read_only(kinds))
        status = np.where(kinds == TaxelFault.DEAD, TaxelStatus.DEAD, TaxelStatus.FAULTY)
        self._status = np.where(kinds != 0, status, 0).astype(np.uint8)
