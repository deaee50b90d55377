"""The report of a CAN log, or of the CAN frames in a bag."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace

import can

from tactile_node.assembly.router import non_data_kind
from tactile_node.errors import LogError
from tactile_node.frames.losses import PadStatistics
from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.library.contacts import Recogniser
from tactile_node.recording.log_source import LogSource
from tactile_node.recording.logged_set_up import Contradiction, LoggedSetUp
from tactile_node.recording.window import WHOLE, Window
from tactile_node.report.bus_record import BusRecord
from tactile_node.report.file_facts import layout_digest, layout_name, recording_of, versions
from tactile_node.report.model import Kind, PadFacts, Report
from tactile_node.report.node_record import NodeRecords
from tactile_node.report.pad_record import PadRecord
from tactile_node.skin.pads import PadSettings, identities_of

POLL = 0.1  # s


class LogReporter:
    """Plays a CAN log once, as fast as possible.

    ``channel`` and ``eds`` as in `LogSource`. Where the set-up in the log contradicts layout or EDS, or other nodes
    were heard that send a pad's COB-IDs, the pad's taxels are left out, unless with ``any_device``. ``bit_rate``
    [bit/s], which no log has. ``on_can_frame`` is called for each CAN frame.
    """

    def __init__(self, path: str, pads: tuple[PadSettings, ...], *, channel: str = '', eds: Sequence[str] = ('',),
                 any_device: bool = False, bit_rate: int | None = None, recogniser: Recogniser | None = None,
                 on_can_frame: Callable[[], object] = lambda: None, window: Window = WHOLE):
        self._path, self._pads, self._any_device = path, pads, any_device
        self._on_can_frame = on_can_frame
        recogniser = recogniser or Recogniser()
        self._records = {pad.name: PadRecord(pad.name, pad.layout.rows, pad.layout.cols, pad.layout.pitch,
                                             pad.layout.value.unit, recogniser) for pad in pads}
        self._contradictions: dict[str, Contradiction] = {}
        self._set_up = None if any_device else LoggedSetUp(pads, identities_of(pads, eds))
        self._bus = BusRecord(bit_rate)
        self._nodes = NodeRecords([(pad.name, pad.node_ids) for pad in pads], _taken(pads))
        self._source = LogSource(path, pads, self._frame, pace=None, channel=channel, any_device=True,
                                 on_message=self._message, window=window)

    def report(self, stop_requested: threading.Event) -> Report:
        """Raises LogError for a log that cannot be read, or is of two buses; KeyboardInterrupt where it was stopped."""
        source = self._source
        source.open()
        source.start()
        while not source.finished.wait(POLL) and not stop_requested.is_set():
            pass
        is_done = source.finished.is_set()
        source.close()
        if not is_done:
            raise KeyboardInterrupt
        statistics = source.statistics()
        if source.failure or statistics.consumer_errors:
            got = source.failure.detail.removesuffix('.') if source.failure else 'an error over its taxel frames'
            raise LogError(self._path, expected='a log to its end', got=got, remedy='No report is written.')
        recording = recording_of(self._path, Kind.CAN_FRAMES, self._bus.begin or 0.0, self._bus.end)
        return Report(
            versions=versions(), pads=tuple(self._pad(pad, statistics.pads[pad.name]) for pad in self._pads),
            nodes=self._nodes.facts(), bus=self._bus.facts(statistics.can_frames),
            recording=replace(recording, unread=statistics.unread, problem=source.problem,
                              damages=tuple(source.damages),
                              clock_jumps=statistics.clock_jumps))

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

    def _pad(self, pad: PadSettings, statistics: PadStatistics) -> PadFacts:
        facts = self._records[pad.name].facts()
        losses = tuple((reason.key, count) for reason, count in statistics.losses.items() if count)
        facts = replace(facts, node_ids=pad.node_ids, layout=layout_name(pad.layout.source), losses=losses,
                        layout_sha256=layout_digest(pad.layout.source), statistics=statistics,
                        strangers=tuple(self._source.strangers.get(pad.name, ())))
        contradiction = self._contradictions.get(pad.name)
        if self._any_device or contradiction is None and not facts.strangers:
            return facts
        return replace(facts, contradiction=contradiction, are_of_others=True, touches=(), touches_left_out=0,
                       small_frames=0, samples=(), health=None)


def _taken(pads: Sequence[PadSettings]) -> frozenset[int]:
    return frozenset(tpdo.cob_id.of(pad.node_ids[tpdo.node]) for pad in pads for tpdo in pad.layout.tpdos) | {
        pad.layout.sync_cob_id for pad in pads}
