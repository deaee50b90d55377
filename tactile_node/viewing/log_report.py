"""Build a report from a CAN log, or from a bag with taxel arrays and, optionally, CAN frames."""

import hashlib
import platform
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import metadata
from pathlib import Path
from typing import Any

import can

from tactile_node.assembly.frame_source import PadStatistics
from tactile_node.assembly.router import non_data_kind
from tactile_node.errors import LogError
from tactile_node.logs.log_reader import CanLogReader
from tactile_node.logs.logged_set_up import Contradiction, LoggedSetUp
from tactile_node.logs.replay_times import WHOLE, TimeWindow
from tactile_node.logs.series import files_of
from tactile_node.logs.topic_bag import (
    DIAGNOSTICS,
    STATUS,
    TAXELS,
    BagMessage,
    TopicBagReader,
    frame_of,
    holds_can_frames,
    pad_of,
)
from tactile_node.package_files import config_path, package_version
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from tactile_node.skin.pads import PadSettings, identities_of
from tactile_node.sources.log_source import LogSource
from tactile_node.taxel_frame import TaxelFrame
from tactile_node.viewing.model import BusReport, Kind, NodeReport, PadReport, Report, ReportedFile
from tactile_node.viewing.node_record import BusRecord, NodeRecords
from tactile_node.viewing.pad_record import PadRecord
from tactile_node.viewing.status_record import StatusRecord
from tactile_node.viewing.touch import TouchList

LIBRARIES = ('python-can', 'canopen', 'numpy', 'scipy', 'rosbags', 'mcap')
DIGEST_CHUNK = 1 << 20  #: [bytes]


def versions() -> tuple[tuple[str, str], ...]:
    """Return names and versions of the software that makes the report, skipping libraries that are not installed."""
    found = []
    for name in LIBRARIES:
        try:
            found.append((name, metadata.version(name)))
        except metadata.PackageNotFoundError:
            continue
    return (('tactile_skin', package_version()), ('Python', platform.python_version()), *found,
            ('system', f'{platform.system()} {platform.machine()}'))


def reported_file(path: str | Path, kind: Kind, begin: float, end: float, **problems: Any) -> ReportedFile:
    """Describe a file, a series of files or a bag folder. Raises OSError if a file cannot be read."""
    path = Path(path)
    files = [file for file in path.rglob('*') if file.is_file()] if path.is_dir() else files_of(path)
    return ReportedFile(path.resolve().name, sum(file.stat().st_size for file in files),
                        '' if path.is_dir() or len(files) > 1 else _sha256(path), kind, begin, end, **problems)


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open('rb') as file:
        while chunk := file.read(DIGEST_CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


END_POLL = 0.1  #: polling period for the end of the log [s]


class LogReporter:
    """Plays a CAN log once, as fast as possible, and makes a report.

    The report omits a pad's taxels if the device setup in the log contradicts the layout or EDS, or if other nodes
    send the pad's COB-IDs.

    Parameters
    ----------
    path
        Path of the log.
    pads
        Pads to report on.
    channel, eds
        As in `LogSource`.
    any_device
        True to report the taxels even if they may come from another device.
    bit_rate
        Bit rate of the bus [bit/s], or None if unknown. A log does not contain the bit rate.
    recogniser
        Shape recogniser to use.
    on_can_frame
        Called for each CAN frame.
    window
        Part of the log to report on.
    """

    def __init__(self, path: str, pads: tuple[PadSettings, ...], *, channel: str = '', eds: Sequence[str] = ('',),
                 any_device: bool = False, bit_rate: int | None = None, recogniser: VisibilityGuard | None = None,
                 on_can_frame: Callable[[], object] = lambda: None, window: TimeWindow = WHOLE):
        self._path, self._pads, self._any_device = path, pads, any_device
        self._on_can_frame = on_can_frame
        recogniser = recogniser or make_recogniser()
        self._records = {pad.name: PadRecord(pad.name, pad.layout.rows, pad.layout.cols, pad.layout.pitch,
                                             pad.layout.value.unit, recogniser) for pad in pads}
        self._contradictions: dict[str, Contradiction] = {}
        self._set_up = None if any_device else LoggedSetUp(pads, identities_of(pads, eds))
        self._bus = BusRecord(bit_rate)
        self._nodes = NodeRecords({node_id: pad.name for pad in pads for node_id in pad.node_ids}, _taken(pads))
        self._source = LogSource(path, pads, self._frame, pace=None, channel=channel, any_device=True,
                                 on_message=self._message, window=window)

    def report(self, stop_requested: threading.Event) -> Report:
        """Return the report.

        Raises
        ------
        LogError
            Raised if the log cannot be read, or if its CAN frames come from two buses.
        KeyboardInterrupt
            Raised if ``stop_requested`` is set.
        """
        source = self._source
        source.open()
        source.start()
        while not source.finished.wait(END_POLL) and not stop_requested.is_set():
            pass
        is_done = source.finished.is_set()
        source.close()
        if not is_done:
            raise KeyboardInterrupt
        statistics = source.statistics()
        if source.failure or statistics.consumer_errors:
            got = source.failure.detail.removesuffix('.') if source.failure else 'an error in a taxel frame'
            raise LogError(self._path, expected='a log that can be played to the end', got=got,
                           remedy='No report was written.')
        recording = reported_file(
            self._path, Kind.CAN_FRAMES, self._bus.begin or 0.0, self._bus.end, unread=statistics.unread,
            problem=source.reader.problem, damages=tuple(source.reader.damages), clock_jumps=statistics.clock_jumps)
        return Report(versions(), recording, tuple(self._pad(pad, statistics.pads[pad.name]) for pad in self._pads),
                      self._nodes.reports(), self._bus.report(statistics.can_frames))

    def _frame(self, pad: str, frame: TaxelFrame) -> None:
        if pad not in self._contradictions:
            self._records[pad].feed(frame)

    def _message(self, message: can.Message) -> None:
        self._on_can_frame()
        self._bus.feed(message)
        self._nodes.feed(message)
        if self._set_up is not None and non_data_kind(message) is None:
            found = self._set_up.feed(message.arbitration_id, bytes(message.data))
            if found is not None:
                self._contradictions.setdefault(found.pad, found)

    def _pad(self, pad: PadSettings, statistics: PadStatistics) -> PadReport:
        report = replace(
            self._records[pad.name].report(), node_ids=pad.node_ids, layout=Path(pad.layout.source).name,
            layout_sha256=_sha256(config_path(pad.layout.source)), statistics=statistics,
            losses=tuple((reason.key, count) for reason, count in statistics.losses.items() if count),
            strangers=tuple(self._source.heard.strangers().get(pad.name, ())))
        contradiction = self._contradictions.get(pad.name)
        if self._any_device or contradiction is None and not report.strangers:
            return report
        return replace(report, contradiction=contradiction, are_of_others=True, touches=TouchList(), samples=(),
                       health=None)


def _taken(pads: Sequence[PadSettings]) -> frozenset[int]:
    return frozenset(tpdo.cob_id.of(pad.node_ids[tpdo.node]) for pad in pads for tpdo in pad.layout.tpdos) | {
        pad.layout.sync_cob_id for pad in pads}


class BagReporter:
    """Reads a bag with taxel arrays and makes a report.

    Parameters
    ----------
    path
        Path of the bag.
    channel
        Topic with the CAN frames, needed if the bag has several such topics.
    bit_rate
        Bit rate of the CAN bus [bit/s], or None if unknown.
    recogniser
        Shape recogniser to use.
    on_message
        Called for each message.
    window
        Part of the bag to report on.
    """

    def __init__(self, path: str, *, channel: str = '', bit_rate: int | None = None,
                 recogniser: VisibilityGuard | None = None, on_message: Callable[[], object] = lambda: None,
                 window: TimeWindow = WHOLE):
        self._path, self._channel, self._bit_rate, self._on_message = path, channel, bit_rate, on_message
        self._reader, self._window = TopicBagReader(path), window
        self._recogniser = recogniser or make_recogniser()
        self._pads: dict[str, PadRecord] = {}
        self._status = StatusRecord()
        self._begin = float('inf')
        self._end = -float('inf')

    def report(self, stop_requested: threading.Event) -> Report:
        """Return the report.

        Raises
        ------
        LogError
            Raised if the bag has no valid taxel array.
        KeyboardInterrupt
            Raised if ``stop_requested`` is set.
        """
        for message in self._reader.messages((TAXELS, STATUS, DIAGNOSTICS), window=self._window):
            if stop_requested.is_set():
                raise KeyboardInterrupt
            self._on_message()
            self._feed(message)
        unread, problem = self._reader.unread.total(), self._reader.problem
        if not self._pads:
            raise LogError(self._path, expected='a taxel array', got=problem or 'none', remedy='Record it again.')
        pads = tuple(replace(record.report(), losses=self._status.losses(name))
                     for name, record in sorted(self._pads.items()))
        misshapen = sum(record.misshapen for record in self._pads.values())
        kind, nodes, bus = Kind.TOPICS, self._status.nodes(), self._status.bus()
        if holds_can_frames(self._path):
            kind = Kind.BOTH
            nodes, of_can_frames = self._of_can_frames(stop_requested)
            bus = replace(of_can_frames, reported=bus.reported)
        recording = reported_file(
            self._path, kind, self._begin, self._end, unread=unread + misshapen, damages=tuple(self._reader.damages),
            problem=problem or ('taxel arrays of another size' if misshapen else ''))
        return Report(versions(), recording, pads, nodes, bus)

    def _feed(self, message: BagMessage) -> None:
        if message.type == TAXELS:
            self._taxels(message)
        elif message.type == STATUS:
            self._status.feed_status(message.stamp, message.content)
        elif STATUS not in self._reader.topics.values():
            self._status.feed_diagnostics(message.stamp, message.content)

    def _taxels(self, message: BagMessage) -> None:
        name, taxels, frame = pad_of(message.topic), message.content, frame_of(message.content)
        if name not in self._pads:
            self._pads[name] = PadRecord(name, taxels.rows, taxels.cols, float(taxels.pitch), taxels.unit,
                                         self._recogniser)
        self._begin, self._end = min(self._begin, frame.stamp), max(self._end, frame.stamp)
        self._pads[name].feed(frame)

    def _of_can_frames(self, stop_requested: threading.Event) -> tuple[tuple[NodeReport, ...], BusReport]:
        """Report on the nodes and the bus.

        Frames are not counted by service, because only a layout identifies TPDOs.
        """
        bus = BusRecord(self._bit_rate)
        nodes = NodeRecords({node.node_id: node.pad for node in self._status.nodes() or ()}, frozenset())
        for message in CanLogReader(self._path, self._channel, self._window):
            if stop_requested.is_set():
                raise KeyboardInterrupt
            self._on_message()
            bus.feed(message)
            nodes.feed(message)
        return nodes.reports(), bus.report(None)
