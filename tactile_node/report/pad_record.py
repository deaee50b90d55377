"""What the taxel frames of one pad say, whether they come from a log or a bag."""

from collections import deque

import numpy as np

from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.library.contacts import Recogniser
from tactile_node.report.kept_entries import LongestGaps
from tactile_node.report.model import PadFacts
from tactile_node.report.taxel_record import TaxelRecord
from tactile_node.report.touch_finder import MAX_PAUSE, TouchFinder

PERIODS = 5000  #: last periods of which the median is taken


class PadRecord:
    """Takes the frames of one pad; those of another shape (rows, cols) are counted in ``misshapen``."""

    def __init__(self, name: str, rows: int, cols: int, pitch: float, unit: str, recogniser: Recogniser):
        self._name, self._shape, self._pitch, self._unit = name, (rows, cols), pitch, unit
        self._touches = TouchFinder(recogniser, pitch, unit)
        self._taxels = TaxelRecord(rows, cols, unit)
        self._gaps = LongestGaps(MAX_PAUSE)
        self._periods: deque[float] = deque(maxlen=PERIODS)
        self._last: TaxelFrame | None = None
        self._frames = self._incomplete = self._lost = 0
        self.misshapen = 0

    def feed(self, frame: TaxelFrame) -> None:
        if frame.values.shape != self._shape:
            self.misshapen += 1
            return
        if self._last is not None:
            self._periods.append(frame.stamp - self._last.stamp)
            self._lost += max(0, frame.sequence - self._last.sequence - 1)  # a driver that starts again counts from 0
        self._last = frame
        self._frames += 1
        self._incomplete += frame.missing_can_frames > 0
        self._gaps.feed(frame.stamp)
        self._taxels.feed(frame)
        self._touches.feed(frame)

    def facts(self) -> PadFacts:
        """The recording has ended."""
        self._touches.end()
        found = self._touches.found
        return PadFacts(
            name=self._name, rows=self._shape[0], cols=self._shape[1], pitch=self._pitch, unit=self._unit,
            frames=self._frames, incomplete=self._incomplete, lost_frames=self._lost,
            period=float(np.median(self._periods)) if self._periods else None, gaps=self._gaps.gaps(),
            gap_count=self._gaps.count, touches=found.touches(),
            touches_left_out=found.left_out, small_frames=found.small_frames,
            samples=tuple(self._touches.samples), health=self._taxels.health() if self._frames else None)
