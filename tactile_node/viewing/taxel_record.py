"""Collect the values that a pad's taxels sent in a recording, and rate the state of each taxel."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from tactile_node.conditioning.tare import rest_limit
from tactile_node.conditioning.taxel_faults import FaultDetector, TaxelFault
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus, read_only


@dataclass(frozen=True)
class TaxelHealth:
    """Statistics of each taxel over all frames. Arrays have the shape (rows, cols) and are read-only."""

    frames: int
    by_status: np.ndarray      #: number of frames with each status, int (TaxelStatus, rows, cols)
    lowest: np.ndarray         #: lowest value, or NaN if the taxel never had a value
    highest: np.ndarray        #: highest value, or NaN if the taxel never had a value
    faults: np.ndarray         #: `TaxelFault` detected from the taxel's values, uint8

    @property
    def valued(self) -> np.ndarray:
        """Number of frames in which each taxel had a value."""
        return self.by_status[[TaxelStatus.VALID, TaxelStatus.SATURATED]].sum(0)

    @property
    def never_changed(self) -> np.ndarray:
        """Mask of the taxels that had a value in at least two frames, always the same one."""
        return (self.valued >= 2) & (self.lowest == self.highest)


class TaxelRecord:
    """Collects the values of one pad's taxels. All frames must have the shape (rows, cols)."""

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
    """Worst known state of a taxel. If several states apply, the highest number is used."""

    GOOD = 0           #: the taxel had a value in every frame, and the value changed
    NEVER_CHANGED = 1  #: the value never changed, which is normal for an untouched taxel of a skin without noise
    SATURATED = 2      #: the taxel was at the end of its range in some frames
    SOME_MISSING = 3   #: the taxel had no value in some frames
    NO_VALUE = 4       #: the taxel had no value in any frame
    FLICKERING = 5
    STUCK = 6          #: the taxel is stuck at one value, or at the end of its range
    DEAD = 7           #: the taxel is dead according to its values, the layout or the driver
    UNMAPPED = 8       #: there is no taxel at this place


FAULTS = Mark.FLICKERING, Mark.STUCK, Mark.DEAD


def no_value_share(health: TaxelHealth) -> np.ndarray:
    """Return each taxel's fraction of frames without a value (rows, cols), or NaN where there is no taxel."""
    share: np.ndarray = 1 - health.valued / max(1, health.frames)
    return np.where(health.by_status[TaxelStatus.UNMAPPED] == health.frames, np.nan, share)


def marks_of(health: TaxelHealth) -> np.ndarray:
    """Return the `Mark` of each taxel, uint8, shape (rows, cols)."""
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
