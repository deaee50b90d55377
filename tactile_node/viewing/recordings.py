"""Recordings that a view can play: a bag of published taxel arrays, or a CAN log, assembled as in the driver."""

import tempfile
import threading
from array import array
from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from tactile_node.assembly.fault_text import failure_text
from tactile_node.errors import ConfigurationError
from tactile_node.logs.replay_times import WHOLE, TimeWindow
from tactile_node.logs.topic_bag import STATUS, TAXELS, TopicBagReader, frame_of, pad_of
from tactile_node.skin.pads import PadSettings
from tactile_node.sources.log_source import LogSource
from tactile_node.taxel_frame import TaxelFrame, read_only
from tactile_node.viewing.states import BusFacts, facts_of, facts_of_status


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


class Timeline:
    """Frames and bus facts by Unix time [s]. One thread may add data while another thread reads."""

    def __init__(self) -> None:
        self._tracks: dict[str, _Track] = {}
        self._fact_times: list[float] = []
        self._facts: list[BusFacts] = []
        self.begin, self.end = np.inf, -np.inf  #: stamps of the first and the last frame

    def add(self, pad: str, frame: TaxelFrame, pitch: float, unit: str) -> bool:
        """Add a frame, or return False without adding it if its geometry differs from the pad's first frame."""
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

    def close(self) -> None:
        for track in self._tracks.values():
            track.file.close()
        self._tracks = {}


class BagRecording:
    """A bag with taxel arrays.

    Parameters
    ----------
    path
        Path of the bag.
    pads
        Pads to show, or empty for all pads in the bag.
    window
        Part of the bag to show.

    Raises
    ------
    LogError
        Raised if the bag has no taxel arrays of this package.
    ConfigurationError
        Raised if a pad is not in the bag.
    """

    def __init__(self, path: str, pads: Sequence[str] = (), window: TimeWindow = WHOLE):
        self._reader, self._window = TopicBagReader(path), window
        self.title = path
        if missing := [pad for pad in pads if pad not in self._reader.pads]:
            raise ConfigurationError('--pads', expected=f'some of {", ".join(self._reader.pads)}, as in the bag',
                                     got=', '.join(missing), remedy='Leave out --pads to show all pads.')
        self.pads = tuple(pads) or self._reader.pads

    def check(self) -> None:
        """Do nothing, because `__init__` has already opened the bag."""

    def read(self, timeline: Timeline, is_stopping: Callable[[], bool]) -> str:
        """Read the whole bag as fast as possible. Return a description of unreadable parts, or '' if there are none."""
        others = 0
        for message in self._reader.messages((TAXELS, STATUS), window=self._window):
            if is_stopping():
                return ''
            if message.type == STATUS:
                timeline.add_facts(message.stamp, facts_of_status(message.content))
                continue
            if pad_of(message.topic) not in self.pads:
                continue
            taxels = message.content
            others += not timeline.add(pad_of(message.topic), frame_of(taxels), float(taxels.pitch), taxels.unit)
        unread = [f'{count} {reason.name.lower()}' for reason, count in self._reader.unread.items()]
        unread += [f'{others} of another size than the first'] if others else []
        return f'not shown: {", ".join(unread)} (last: {self._reader.problem})' if unread else ''


FACTS_PERIOD = 0.5  #: period at which the bus state is read [s], in log time for a log
READ_POLL = 0.2      #: polling period while a log is being read [s]


class LogRecording:
    """A CAN log.

    Parameters
    ----------
    path
        Path of the log.
    pads
        Pads to show.
    channel, any_device, eds
        As in `LogSource`.
    window
        Part of the log to show.
    """

    def __init__(self, path: str, pads: tuple[PadSettings, ...], channel: str = '', any_device: bool = False,
                 window: TimeWindow = WHOLE, eds: Sequence[str] = ('',)):
        self._path, self._settings = path, pads
        self._channel, self._any_device, self._window = channel, any_device, window
        self._eds = eds
        self._geometry = {pad.name: (pad.layout.pitch, pad.layout.value.unit) for pad in pads}
        self.title = path
        self.pads = tuple(pad.name for pad in pads)

    def check(self) -> None:
        """Raise LogError if the log cannot be read at all."""
        source = self._source(lambda pad, frame: None, lambda stamp: None)
        source.open()
        source.close()

    def read(self, timeline: Timeline, is_stopping: Callable[[], bool]) -> str:
        looked = 0.0

        def on_frame(pad: str, frame: TaxelFrame) -> None:
            timeline.add(pad, frame, *self._geometry[pad])

        def on_time(stamp: float) -> None:
            nonlocal looked
            if not 0 <= stamp - looked < FACTS_PERIOD:
                looked = stamp
                timeline.add_facts(stamp, facts_of(source.statistics(), source.health(), load_is_known=False))

        source = self._source(on_frame, on_time)
        source.open()
        source.start()
        while not source.finished.wait(READ_POLL) and not is_stopping():
            pass
        source.close()
        timeline.add_facts(looked, facts_of(source.statistics(), source.health(), load_is_known=False))
        return failure_text(source.failure) or _of_others(source) or _without_taxels(timeline) or _unread(source)

    def _source(self, on_frame: Callable[[str, TaxelFrame], None], on_time: Callable[[float], None]) -> LogSource:
        return LogSource(self._path, self._settings, on_frame, pace=None, channel=self._channel, on_time=on_time,
                         any_device=self._any_device, window=self._window, eds=self._eds)


def _of_others(source: LogSource) -> str:
    """Return a warning if other nodes send a pad's COB-IDs, because the taxels may belong to those nodes."""
    return '; '.join(f'pad {pad}: node {", ".join(map(str, nodes))} sends its COB-IDs, not its own: check --node-id'
                     for pad, nodes in source.heard.strangers().items())


def _unread(source: LogSource) -> str:
    unread, last = source.statistics().unread, source.reader.problem
    return f'not shown: {unread} lines or parts that could not be read (last: {last})' if unread else ''


def _without_taxels(timeline: Timeline) -> str:
    return '' if timeline.begin <= timeline.end else 'no taxel frame of these pads in the log: check --node-id'
