"""The taxel frames of a recording on disk, found by time: a recording may be larger than the memory."""

import math
import os
import tempfile
from array import array
from bisect import bisect_right
from typing import NamedTuple

import numpy as np

from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.read_only import read_only
from tactile_node.view.states import BusFacts


class _Track:
    """Frames of one pad: an index in memory, the taxels in a file."""

    def __init__(self, shape: tuple[int, ...], pitch: float, unit: str):
        self.shape = shape
        self.pitch, self.unit = pitch, unit
        self.stamps, self.sequences, self.missing = array('d'), array('Q'), array('L')
        self.places = array('d')  # as stamps, but never back
        self.file = tempfile.TemporaryFile()
        self.size = math.prod(shape) * (4 + 1)

    def add(self, frame: TaxelFrame) -> None:
        record = frame.values.astype('<f4').tobytes() + frame.status.astype(np.uint8).tobytes()
        os.pwrite(self.file.fileno(), record, len(self.places) * self.size)
        self.stamps.append(frame.stamp)
        self.sequences.append(frame.sequence)
        self.missing.append(frame.missing_can_frames)
        self.places.append(max(frame.stamp, self.places[-1]) if self.places else frame.stamp)  # last: it is complete

    def frame(self, index: int) -> TaxelFrame:
        record = os.pread(self.file.fileno(), self.size, index * self.size)
        taxels = math.prod(self.shape)
        values = np.frombuffer(record, '<f4', taxels).reshape(self.shape)
        status = np.frombuffer(record, np.uint8, taxels, 4 * taxels).reshape(self.shape)
        return TaxelFrame(self.stamps[index], self.sequences[index], read_only(values), read_only(status),
                          self.missing[index])


class Moment(NamedTuple):
    """A pad's newest frame at a time of the recording."""

    number: int  #: of the pad's frames
    frame: TaxelFrame
    pitch: float
    unit: str


class Timeline:
    """One thread adds, another looks up. Times are Unix time [s]."""

    def __init__(self) -> None:
        self._tracks: dict[str, _Track] = {}
        self._fact_times: list[float] = []
        self._facts: list[BusFacts] = []
        self.begin, self.end = np.inf, -np.inf  #: stamps of the first and the last frame

    def add(self, pad: str, frame: TaxelFrame, pitch: float, unit: str) -> bool:
        """Add a frame; False where it is left out, since its taxels are others than those of the pad's first one."""
        track = self._tracks.get(pad)
        if track is None:
            track = self._tracks[pad] = _Track(frame.values.shape, pitch, unit)
        if (track.shape, track.pitch, track.unit) != (frame.values.shape, pitch, unit):
            return False
        track.add(frame)
        self.begin, self.end = min(self.begin, frame.stamp), max(self.end, frame.stamp)
        return True

    def add_facts(self, stamp: float, facts: BusFacts) -> None:
        self._facts.append(facts)
        self._fact_times.append(max(stamp, self._fact_times[-1]) if self._fact_times else stamp)

    def index(self, pad: str, time: float) -> int:
        """Return which frame of ``pad`` is the newest at ``time``, -1: none."""
        track = self._tracks.get(pad)
        return -1 if track is None else bisect_right(track.places, time) - 1

    def moment(self, pad: str, index: int) -> Moment:
        """Return the frame that `index` has found."""
        track = self._tracks[pad]
        return Moment(index, track.frame(index), track.pitch, track.unit)

    def facts(self, time: float) -> tuple[BusFacts | None, float]:
        """Return the newest facts at ``time`` and their age [s]; with the last frame, also those that came after it."""
        index = len(self._facts) - 1 if time >= self.end else bisect_right(self._fact_times, time) - 1
        return (self._facts[index], max(time - self._fact_times[index], 0.0)) if index >= 0 else (None, 0.0)

    def close(self) -> None:
        for track in self._tracks.values():
            track.file.close()
        self._tracks = {}
