"""The report of our topics in a bag; the CAN frames in it, where it has some, give bus and nodes."""

import threading
from collections.abc import Callable
from dataclasses import replace

from tactile_node.errors import LogError
from tactile_node.library.contacts import Recogniser
from tactile_node.recording.log_reader import CanLogReader
from tactile_node.recording.taxel_message import frame_of, geometry_of
from tactile_node.recording.topic_bag import (
    DIAGNOSTICS,
    STATUS,
    TAXELS,
    BagMessage,
    TopicBagReader,
    holds_can_frames,
    pad_of,
)
from tactile_node.recording.window import WHOLE, Window
from tactile_node.report.bus_record import BusRecord
from tactile_node.report.file_facts import recording_of, versions
from tactile_node.report.model import BusFacts, Kind, NodeFacts, PadFacts, Report
from tactile_node.report.node_record import NodeRecords
from tactile_node.report.pad_record import PadRecord
from tactile_node.report.status_record import StatusRecord


class BagReporter:
    """Reads a bag with taxel arrays. ``channel`` (a topic), ``bit_rate`` [bit/s]: of its CAN frames."""

    def __init__(self, path: str, *, channel: str = '', bit_rate: int | None = None,
                 recogniser: Recogniser | None = None, on_message: Callable[[], object] = lambda: None,
                 window: Window = WHOLE):
        self._path, self._channel, self._bit_rate, self._on_message = path, channel, bit_rate, on_message
        self._reader, self._window = TopicBagReader(path), window
        self._recogniser = recogniser or Recogniser()
        self._pads: dict[str, PadRecord] = {}
        self._status = StatusRecord()
        self._begin = float('inf')
        self._end = -float('inf')

    def report(self, stop_requested: threading.Event) -> Report:
        """Raises LogError for a bag without a whole taxel array; KeyboardInterrupt where it was stopped."""
        for message in self._reader.messages((TAXELS, STATUS, DIAGNOSTICS), window=self._window):
            if stop_requested.is_set():
                raise KeyboardInterrupt
            self._on_message()
            self._feed(message)
        unread, problem = self._reader.unread.total(), self._reader.problem
        if not self._pads:
            raise LogError(self._path, expected='a taxel array', got=problem or 'none', remedy='Record it again.')
        pads = tuple(self._pad(name) for name in sorted(self._pads))
        misshapen = sum(record.misshapen for record in self._pads.values())
        has_can_frames = holds_can_frames(self._path)
        nodes, bus = self._of_can_frames(stop_requested) if has_can_frames else (self._status.nodes(), self._bus())
        kind = Kind.BOTH if has_can_frames else Kind.TOPICS
        return Report(
            versions=versions(), pads=pads, nodes=nodes, bus=replace(bus, reported=self._status.reported),
            recording=replace(recording_of(self._path, kind, self._begin, self._end), unread=unread + misshapen,
                              problem=problem or ('taxel arrays of another size' if misshapen else ''),
                              damages=tuple(self._reader.damages)))

    def _feed(self, message: BagMessage) -> None:
        if message.type == TAXELS:
            self._taxels(message)
        elif message.type == STATUS:
            self._status.feed_status(message.stamp, message.content)
        elif STATUS not in self._reader.topics.values():
            self._status.feed_diagnostics(message.stamp, message.content)

    def _taxels(self, message: BagMessage) -> None:
        name, frame = pad_of(message.topic), frame_of(message.content)
        if name not in self._pads:
            known = geometry_of(message.content)
            self._pads[name] = PadRecord(name, known.rows, known.cols, known.pitch, known.unit, self._recogniser)
        self._begin, self._end = min(self._begin, frame.stamp), max(self._end, frame.stamp)
        self._pads[name].feed(frame)

    def _pad(self, name: str) -> PadFacts:
        return replace(self._pads[name].facts(), losses=self._status.losses(name))

    def _bus(self) -> BusFacts:
        return BusFacts(can_frames=None, load=self._status.load(), gaps=None, gap_count=None, commands=None,
                        command_count=None, reported=None)

    def _of_can_frames(self, stop_requested: threading.Event) -> tuple[tuple[NodeFacts, ...], BusFacts]:
        """Services are not counted: which COB-IDs are TPDOs, only a layout says."""
        bus, nodes = BusRecord(self._bit_rate), NodeRecords(self._status.pads_of_nodes(), frozenset())
        for message in CanLogReader(self._path, self._channel, self._window):
            if stop_requested.is_set():
                raise KeyboardInterrupt
            self._on_message()
            bus.feed(message)
            nodes.feed(message)
        return nodes.facts(), replace(bus.facts({}), can_frames=None)
