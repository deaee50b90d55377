"""Make a report from a recording: a CAN log, or a bag with taxel arrays."""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import can

from tactile_node.assembly.facts import pad_counts
from tactile_node.errors import LogError
from tactile_node.package_files import config_path
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from tactile_node.skin.pads import PadSettings
from tactile_node.taxel_frame import TaxelFrame
from tactile_node.viewing.model import PadReport, Report
from tactile_node.viewing.node_record import BusRecord, NodeRecords
from tactile_node.viewing.pad_record import PadRecord
from tactile_node.viewing.recordings import BagRecording, LogRecording, Sink
from tactile_node.viewing.reported_file import Kind, ReportedFile, sha256_of
from tactile_node.viewing.status_record import StatusRecord
from tactile_node.viewing.touch import TouchList


class LogReporter(Sink):
    """Reads a CAN log once, and makes a report.

    The report omits a pad's taxels if the device set-up in the log contradicts the layout or EDS, or if other nodes
    send the pad's COB-IDs.

    Parameters
    ----------
    recording
        The log.
    bit_rate
        Bit rate of the bus [bit/s], or None if unknown. A log does not contain the bit rate.
    recogniser
        Shape recogniser to use.
    on_message
        Called for each CAN frame.
    """

    def __init__(self, recording: LogRecording, *, bit_rate: int | None = None,
                 recogniser: VisibilityGuard | None = None, on_message: Callable[[], object] = lambda: None):
        self._recording, self._on_message, pads = recording, on_message, recording.settings
        self._bus = BusRecord(bit_rate)
        recogniser = recogniser or make_recogniser()
        self._pads = {pad.name: PadRecord(pad.name, pad.layout.rows, pad.layout.cols, pad.layout.pitch,
                                          pad.layout.value.unit, recogniser) for pad in pads}
        self._nodes = NodeRecords({node_id: pad.name for pad in pads for node_id in pad.node_ids}, _taken(pads))

    def add(self, pad: str, frame: TaxelFrame, pitch: float, unit: str) -> bool:
        return self._pads[pad].feed(frame)

    def add_message(self, message: can.Message) -> None:
        self._on_message()
        self._bus.feed(message)
        self._nodes.feed(message)

    def report(self, stop_requested: threading.Event) -> Report:
        """Return the report.

        Raises
        ------
        LogError
            Raised if the log cannot be read, or if its CAN frames come from two buses.
        KeyboardInterrupt
            Raised if ``stop_requested`` is set.
        """
        log = self._recording
        log.read(self, stop_requested)
        if stop_requested.is_set():
            raise KeyboardInterrupt
        facts = log.source.facts()
        recording = ReportedFile.of(
            log.title, Kind.CAN_FRAMES, self._bus.begin or 0.0, self._bus.end, unread=log.unread, problem=log.problem,
            damages=log.damages, clock_jumps=facts.clock_jumps)
        return Report(recording, tuple(self._pad(pad, pad_counts(facts.pad(pad.name))) for pad in log.settings),
                      self._nodes.reports(), self._bus.report(facts.can_frames))

    def _pad(self, pad: PadSettings, counts: Mapping[str, int]) -> PadReport:
        report = replace(
            self._pads[pad.name].report(), node_ids=pad.node_ids, layout=Path(pad.layout.source).name,
            layout_sha256=sha256_of(config_path(pad.layout.source)), counts=counts,
            strangers=self._recording.strangers(pad.name))
        contradiction = self._recording.contradictions.get(pad.name)
        if self._recording.any_device or contradiction is None and not report.strangers:
            return report
        return replace(report, contradiction=contradiction, are_of_others=True, touches=TouchList(), samples=(),
                       health=None)


def _taken(pads: Sequence[PadSettings]) -> frozenset[int]:
    return frozenset(tpdo.cob_id.of(pad.node_ids[tpdo.node]) for pad in pads for tpdo in pad.layout.tpdos) | {
        pad.layout.sync_cob_id for pad in pads}


class BagReporter(Sink):
    """Reads a bag with taxel arrays once, and makes a report.

    Parameters
    ----------
    recording
        The bag.
    recogniser
        Shape recogniser to use.
    on_message
        Called for each message.
    """

    def __init__(self, recording: BagRecording, *, recogniser: VisibilityGuard | None = None,
                 on_message: Callable[[], object] = lambda: None):
        self._recording, self._on_message = recording, on_message
        self._recogniser = recogniser or make_recogniser()
        self._pads: dict[str, PadRecord] = {}
        self._status = StatusRecord()
        self._begin = float('inf')  # stamp of the first taxel frame [s]
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
        bag = self._recording
        bag.read(self, stop_requested)
        if stop_requested.is_set():
            raise KeyboardInterrupt
        if not self._pads:
            raise LogError(bag.title, expected='a taxel array', got=bag.problem or 'none', remedy='Record it again.')
        pads = tuple(replace(record.report(), counts=self._status.counts(name))
                     for name, record in sorted(self._pads.items()))
        recording = ReportedFile.of(bag.title, Kind.TOPICS, self._begin, self._end, unread=bag.unread,
                                    problem=bag.problem, damages=bag.damages)
        return Report(recording, pads, self._status.nodes(), self._status.bus())

    def add(self, pad: str, frame: TaxelFrame, pitch: float, unit: str) -> bool:
        self._on_message()
        if pad not in self._pads:
            rows, cols = frame.values.shape
            self._pads[pad] = PadRecord(pad, rows, cols, pitch, unit, self._recogniser)
        self._begin, self._end = min(self._begin, frame.stamp), max(self._end, frame.stamp)
        return self._pads[pad].feed(frame)

    def add_facts(self, stamp: float, facts: Any) -> None:
        self._on_message()
        self._status.feed(stamp, facts)
