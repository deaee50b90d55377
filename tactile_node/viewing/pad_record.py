"""Collect the facts about one pad in a recording: its frames, gaps, touches and taxels."""

from collections import deque

import numpy as np

from tactile_node.shape.methods import VisibilityGuard
from tactile_node.taxel_frame import TaxelFrame
from tactile_node.viewing.model import LongestGaps, PadReport
from tactile_node.viewing.taxel_record import TaxelRecord
from tactile_node.viewing.touch_finder import MAX_PAUSE, ReportedTouchFinder

MEDIAN_PERIODS = 5000  #: number of latest periods used for the median


class PadRecord:
    """Processes the frames of one pad."""

    def __init__(self, name: str, rows: int, cols: int, pitch: float, unit: str, recogniser: VisibilityGuard):
        self._name, self._shape, self._pitch, self._unit = name, (rows, cols), pitch, unit
        self._touches = ReportedTouchFinder(name, pitch, unit, recogniser)
        self._taxels = TaxelRecord(rows, cols, unit)
        self._gaps = LongestGaps(MAX_PAUSE)
        self._periods: deque[float] = deque(maxlen=MEDIAN_PERIODS)
        self._last: TaxelFrame | None = None
        self._frames = self._incomplete = self._lost = 0

    def feed(self, frame: TaxelFrame) -> bool:
        """Process a frame, or return False without using it if its number of rows or columns differs."""
        if frame.values.shape != self._shape:
            return False
        if self._last is not None:
            self._periods.append(frame.stamp - self._last.stamp)
            # a restarted driver starts again at sequence number 0
            self._lost += max(0, frame.sequence - self._last.sequence - 1)
        self._last = frame
        self._frames += 1
        self._incomplete += frame.missing_can_frames > 0
        self._gaps.feed(frame.stamp)
        self._taxels.feed(frame)
        self._touches.feed(frame)
        return True

    def report(self) -> PadReport:
        """End the last touch and return the report on the pad."""
        self._touches.end()
        return PadReport(
            self._name, *self._shape, self._pitch, self._unit, self._frames, self._incomplete, self._lost,
            period=float(np.median(self._periods)) if self._periods else None, gaps=self._gaps,
            touches=self._touches.found, samples=tuple(self._touches.samples),
            health=self._taxels.health() if self._frames else None)
