"""Make a report from a bag with taxel arrays and, optionally, CAN frames."""

import threading
from collections.abc import Callable
from dataclasses import replace

from tactile_node.errors import LogError
from tactile_node.logs.log_reader import CanLogReader
from tactile_node.logs.replay_times import WHOLE, TimeWindow
from tactile_node.logs.topic_bag import (
    STATUS,
    TAXELS,
    BagMessage,
    TopicBagReader,
    frame_of,
    holds_can_frames,
    pad_of,
)
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from tactile_node.viewing.model import BusReport, NodeReport, Report
from tactile_node.viewing.node_record import BusRecord, NodeRecords
from tactile_node.viewing.pad_record import PadRecord
from tactile_node.viewing.reported_file import Kind, ReportedFile
from tactile_node.viewing.status_record import StatusRecord


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
        for message in self._reader.messages((TAXELS, STATUS), window=self._window):
            if stop_requested.is_set():
                raise KeyboardInterrupt
            self._on_message()
            self._feed(message)
        unread, problem = self._reader.unread.total(), self._reader.problem
        if not self._pads:
            raise LogError(self._path, expected='a taxel array', got=problem or 'none', remedy='Record it again.')
        pads = tuple(replace(record.report(), counts=self._status.counts(name))
                     for name, record in sorted(self._pads.items()))
        misshapen = sum(record.misshapen for record in self._pads.values())
        kind, nodes, bus = Kind.TOPICS, self._status.nodes(), self._status.bus()
        if holds_can_frames(self._path):
            kind = Kind.BOTH
            nodes, of_can_frames = self._of_can_frames(stop_requested)
            bus = replace(of_can_frames, reported=bus.reported)
        recording = ReportedFile.of(
            self._path, kind, self._begin, self._end, unread=unread + misshapen, damages=tuple(self._reader.damages),
            problem=problem or ('taxel arrays of another size' if misshapen else ''))
        return Report(recording, pads, nodes, bus)

    def _feed(self, message: BagMessage) -> None:
        if message.type == TAXELS:
            self._taxels(message)
        else:
            self._status.feed(message.stamp, message.content)

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
