"""The health of a pad's taxels, counted frame by frame."""

import numpy as np

from tactile_node.conditioning.limits import rest_limit
from tactile_node.conditioning.taxel_faults import FaultDetector
from tactile_node.frames.taxel_frame import TaxelFrame, TaxelStatus
from tactile_node.read_only import read_only
from tactile_node.report.model import TaxelHealth

STATUSES = len(TaxelStatus)


class TaxelRecord:
    """Of one pad, whose frames have one shape (rows, cols)."""

    def __init__(self, rows: int, cols: int, unit: str):
        self._by_status = np.zeros((STATUSES, rows * cols), np.int64)
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
