"""Frames, bus facts and grasps of a recording by time."""

import tempfile
import threading
from array import array
from bisect import bisect_right
from typing import NamedTuple

import numpy as np

from tactile_node.assembly.facts import BusFacts
from tactile_node.taxel_frame import TaxelFrame, read_only
from tactile_node.viewing.recordings import Sink
from tactile_node.viewing.states import GraspFacts


class _Track:
    """Frames of one pad. The index is kept in memory, and the taxels in a temporary file."""

    def __init__(self, shape: tuple[int, ...], pitch: float, unit: str):
        self.geometry = shape, pitch, unit
        self.places = array('d')  # stamps, adjusted so that they never decrease
        self.file = tempfile.TemporaryFile()
        self._lock = threading.Lock()  # guards the file position, because Windows lacks os.pread
        self._record = np.dtype([('stamp', 'f8'), ('sequence', 'u8'), ('values', 'f4', shape),
                                 ('status', 'u1', shape), ('missing', 'u4')])

    def add(self, frame: TaxelFrame) -> None:
        record = np.array((frame.stamp, frame.sequence, frame.values, frame.status, frame.missing_can_frames),
                          self._record)
        with self._lock:
            self.file.seek(len(self.places) * self._record.itemsize)
            self.file.write(record.tobytes())
        self.places.append(max(frame.stamp, self.places[-1]) if self.places else frame.stamp)  # after the write

    def frame(self, index: int) -> TaxelFrame:
        size = self._record.itemsize
        with self._lock:
            self.file.seek(index * size)
            found = np.frombuffer(self.file.read(size), self._record)[0]
        return TaxelFrame(float(found['stamp']), int(found['sequence']), read_only(found['values']),
                          read_only(found['status']), int(found['missing']))


class Moment(NamedTuple):
    """Newest frame of a pad at a given time in the recording."""

    number: int  #: index of the frame among the pad's frames
    frame: TaxelFrame
    pitch: float
    unit: str


class Timeline(Sink):
    """Frames, bus facts and grasps by Unix time [s]. One thread may add data while another thread reads."""

    def __init__(self) -> None:
        self._tracks: dict[str, _Track] = {}
        self._fact_times: list[float] = []
        self._facts: list[BusFacts] = []
        self._grasp_times = array('d')     # as places of a track
        self._grasp_acquired = array('d')  # time at which the data of each grasp were acquired
        self._grasps: list[GraspFacts] = []
        self._distinct_grasps: dict[GraspFacts, GraspFacts] = {}  # keeps one object of equal grasps, to save memory
        self.begin, self.end = np.inf, -np.inf  #: stamps of the first and the last frame

    def add(self, pad: str, frame: TaxelFrame, pitch: float, unit: str) -> bool:
        geometry = frame.values.shape, pitch, unit
        if pad not in self._tracks:
            self._tracks[pad] = _Track(*geometry)
        track = self._tracks[pad]
        if track.geometry != geometry:
            return False
        track.add(frame)
        self.begin, self.end = min(self.begin, frame.stamp), max(self.end, frame.stamp)
        return True

    def add_facts(self, stamp: float, facts: BusFacts) -> None:
        self._facts.append(facts)
        self._fact_times.append(max(stamp, self._fact_times[-1]) if self._fact_times else stamp)

    def add_grasp(self, stamp: float, grasp: GraspFacts, acquired: float) -> None:
        self._grasps.append(self._distinct_grasps.setdefault(grasp, grasp))
        self._grasp_acquired.append(acquired)
        self._grasp_times.append(max(stamp, self._grasp_times[-1]) if self._grasp_times else stamp)

    def index(self, pad: str, time: float) -> int:
        """Return the index of the newest frame of ``pad`` at ``time``, or -1 if there is none."""
        track = self._tracks.get(pad)
        return -1 if track is None else bisect_right(track.places, time) - 1

    def moment(self, pad: str, index: int) -> Moment:
        """Return the frame at an ``index`` that `Timeline.index` returned."""
        track = self._tracks[pad]
        _, pitch, unit = track.geometry
        return Moment(index, track.frame(index), pitch, unit)

    def facts(self, time: float) -> tuple[BusFacts | None, float]:
        """Return the newest facts at ``time`` and their age [s]. For the last frame, facts recorded later count too."""
        index = len(self._facts) - 1 if time >= self.end else bisect_right(self._fact_times, time) - 1
        return (self._facts[index], max(time - self._fact_times[index], 0.0)) if index >= 0 else (None, 0.0)

    def grasp(self, time: float) -> tuple[GraspFacts | None, float]:
        """Return the newest grasp at ``time``, or None if there is none yet, and the age of its data [s]."""
        index = bisect_right(self._grasp_times, time) - 1
        return (self._grasps[index], time - self._grasp_acquired[index]) if index >= 0 else (None, np.nan)

    def close(self) -> None:
        for track in self._tracks.values():
            track.file.close()
        self._tracks = {}
