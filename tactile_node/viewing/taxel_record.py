"""What the taxels of a pad sent over a recording, and the worst that is known of each."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from tactile_node.conditioning.tare import rest_limit
from tactile_node.conditioning.taxel_faults import FaultDetector, TaxelFault
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus, read_only


@dataclass(frozen=True)
class TaxelHealth:
    """Counts by taxel over all frames; arrays are read-only, (rows, cols)."""

    frames: int
    by_status: np.ndarray      #: int, (TaxelStatus, rows, cols): frames in which the taxel had this status
    lowest: np.ndarray         #: least value; NaN: never had one
    highest: np.ndarray
    faults: np.ndarray         #: uint8 TaxelFault, by what it sent

    @property
    def valued(self) -> np.ndarray:
        """Frames in which each taxel had a value."""
        return self.by_status[[TaxelStatus.VALID, TaxelStatus.SATURATED]].sum(0)

    @property
    def never_changed(self) -> np.ndarray:
        """Bool: had a value in two frames or more, and always the same."""
        return (self.valued >= 2) & (self.lowest == self.highest)


class TaxelRecord:
    """Record of one pad's taxels; its frames have one shape (rows, cols)."""

    def __init__(self, rows: int, cols: int, unit: str):
        self._by_status = np.zeros((len(TaxelStatus), rows * cols), np.int64)
        self._places = np.arange(rows * cols)
        self._lowest = np.full((rows, cols), np.nan)
        self._highest = np.full((rows, cols), np.nan)
        self._detector = FaultDetector(rows, cols, rest_limit(0.0, unit))
        self._frames = 0

    def feed(self, frame: TaxelFrame) -> None:
        self._frames += 1
        self._by_status[frame.status.reshape(-1), self._places] += 1
        self._lowest = np.fmin(self._lowest, frame.values)
        self._highest = np.fmax(self._highest, frame.values)
        self._detector.update(frame.stamp, frame.values, 0.0, frame.status == TaxelStatus.SATURATED)

    def health(self) -> TaxelHealth:
        return TaxelHealth(frames=self._frames, by_status=read_only(self._by_status.reshape(-1, *self._lowest.shape)),
                           lowest=read_only(self._lowest), highest=read_only(self._highest),
                           faults=self._detector.faults.kinds)


class Mark(IntEnum):
    """The worst that is known of a taxel; a later one prevails."""

    GOOD = 0           #: had a value in every frame, which changed
    NEVER_CHANGED = 1  #: an untouched taxel of a quiet skin does not either
    SATURATED = 2      #: at the end of its range in some frames
    SOME_MISSING = 3   #: without a value in some frames
    NO_VALUE = 4       #: without a value in every frame
    FLICKERING = 5
    STUCK = 6          #: also at the end of its range
    DEAD = 7           #: by what it sent, by the layout or the driver
    UNMAPPED = 8       #: no place of a taxel


FAULTS = Mark.FLICKERING, Mark.STUCK, Mark.DEAD


def no_value_share(health: TaxelHealth) -> np.ndarray:
    """Return, for each taxel, the share of frames without a value; NaN where there is no taxel. (rows, cols)."""
    share: np.ndarray = 1 - health.valued / max(1, health.frames)
    return np.where(health.by_status[TaxelStatus.UNMAPPED] == health.frames, np.nan, share)


def marks_of(health: TaxelHealth) -> np.ndarray:
    """Return the Mark of each taxel, uint8, (rows, cols)."""
    missing, faults, counts = no_value_share(health), health.faults, health.by_status
    marks = np.zeros(missing.shape, np.uint8)
    for mark, places in (
            (Mark.NEVER_CHANGED, health.never_changed),
            (Mark.SATURATED, counts[TaxelStatus.SATURATED] > 0),
            (Mark.SOME_MISSING, missing > 0),
            (Mark.NO_VALUE, missing == 1),
            (Mark.FLICKERING, faults == TaxelFault.FLICKERING),
            (Mark.STUCK, (faults == TaxelFault.STUCK) | (faults == TaxelFault.SATURATED)
             | (counts[TaxelStatus.FAULTY] > 0)),
            (Mark.DEAD, (faults == TaxelFault.DEAD) | (counts[TaxelStatus.DEAD] > 0)),
            (Mark.UNMAPPED, np.isnan(missing))):
        marks[places] = mark
    return marks
