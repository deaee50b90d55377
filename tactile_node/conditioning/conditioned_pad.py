"""All that is done to one pad's frames between the bus and their consumers."""

from typing import NamedTuple

import numpy as np

from tactile_node.conditioning.gain import ResponseCurve
from tactile_node.conditioning.tare import TaredPad, ZeroState
from tactile_node.conditioning.taxel_faults import FaultDetector, FaultyTaxels, TaxelFault
from tactile_node.errors import HalfZeroedError
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus, read_only, without_any_value

MOST_NAMED = 20  #: taxels of a kind in the text


def faults_text(faults: FaultyTaxels) -> str:
    """Return the faulty taxels by kind: 'dead: (3, 4), (5, 0); stuck: (1, 2)', MOST_NAMED of each kind at most."""
    found = {kind: faults.places(kind) for kind in TaxelFault if kind}
    return '; '.join(f'{kind.name.lower()}: {", ".join(map(str, places[:MOST_NAMED]))}'
                     + (f' and {len(places) - MOST_NAMED} more' if len(places) > MOST_NAMED else '')
                     for kind, places in found.items() if places)


class PadCondition(NamedTuple):
    """What is known of a pad."""

    faults: FaultyTaxels
    unchanged: float = 0.0  #: for how long no taxel has read another value [s]
    is_frozen: bool = False
    zero: ZeroState = ZeroState.VALID  #: unless VALID, no value is valid
    zero_error: HalfZeroedError | None = None  #: what the device reported, when it is PARTLY_ZEROED
    other_publishers: tuple[str, ...] = ()  #: nodes that publish taxels of this pad, too, by full name


class ConditionedPad:
    """Masks faulty taxels, subtracts the zero, applies the gains and the curve, in this order.

    value = curve(gain x (reading - zero)), NaN where faulty.

    ``known`` are faulty and taken out from the first frame; ``detector`` finds more, which are reported and, with
    ``masks``, taken out too.
    A pad whose readings do not change by one count for ``frozen_after`` [s] has stopped sampling: no value is valid,
    all are STALE. That is for skins that are never quite still; 0: never.
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
        self.faults = known  #: and found
        self._found: FaultyTaxels | None = None
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
        zero = 0.0 if self.tared.offset is None else self.tared.offset
        found = self.detector.update(frame.stamp, frame.values, zero, frame.status == TaxelStatus.SATURATED)
        if found is not self._found:
            self._found = found
            self._combine(found)
        self._count_unchanged(frame)
        frame = self._without_faulty(frame)
        if self.is_frozen:
            frame = without_any_value(frame)
        frame = self.tared.feed(frame)
        if self.gains is not None:
            frame = frame._replace(values=read_only(frame.values * self.gains))
        if self._curve is not None:
            frame = frame._replace(values=read_only(self._curve(frame.values)))
        return frame

    def _count_unchanged(self, frame: TaxelFrame) -> None:
        """Only time in which readings came counts; stamps that go back start it again."""
        step, self._stamp = frame.stamp - self._stamp, frame.stamp
        if self.detector.has_changed or step < 0:
            self.unchanged = 0.0
        elif step < 2.0 and np.isfinite(frame.values).any():
            self.unchanged += step

    def _combine(self, found: FaultyTaxels) -> None:
        kinds = np.where(self._known.kinds != 0, self._known.kinds, found.kinds)
        self.faults = FaultyTaxels(read_only(kinds))
        status = np.where(kinds == TaxelFault.DEAD, TaxelStatus.DEAD, TaxelStatus.FAULTY)
        self._status = np.where(kinds != 0, status, 0).astype(np.uint8)

    def _without_faulty(self, frame: TaxelFrame) -> TaxelFrame:
        faulty = self._status != 0 if self.masks else self._known.kinds != 0
        if not faulty.any():
            return frame
        return frame._replace(values=read_only(np.where(faulty, np.float32(np.nan), frame.values)),
                              status=read_only(np.where(faulty, self._status, frame.status)))
