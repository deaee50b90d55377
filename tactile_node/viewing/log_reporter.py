"""Make a report from a CAN log."""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import can

from tactile_node.assembly.facts import pad_counts
from tactile_node.assembly.router import non_data_kind
from tactile_node.errors import LogError
from tactile_node.logs.logged_set_up import Contradiction, LoggedSetUp
from tactile_node.logs.replay_times import WHOLE, TimeWindow
from tactile_node.package_files import config_path
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from tactile_node.skin.pads import PadSettings, identities_of
from tactile_node.sources.log_source import LogSource
from tactile_node.taxel_frame import TaxelFrame
from tactile_node.viewing.model import PadReport, Report
from tactile_node.viewing.node_record import BusRecord, NodeRecords
from tactile_node.viewing.pad_record import PadRecord
from tactile_node.viewing.reported_file import Kind, ReportedFile, sha256_of
from tactile_node.viewing.touch import TouchList

END_POLL = 0.1  #: polling period for the end of the log [s]


class LogReporter:
    """Plays a CAN log once, as fast as possible, and makes a report.

    The report omits a pad's taxels if the device set-up in the log contradicts the layout or EDS, or if other nodes
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
        facts = source.facts()
        if source.failure or facts.consumer_errors:
            got = source.failure.detail.removesuffix('.') if source.failure else 'an error in a taxel frame'
            raise LogError(self._path, expected='a log that can be played to the end', got=got,
                           remedy='No report was written.')
        recording = ReportedFile.of(
            self._path, Kind.CAN_FRAMES, self._bus.begin or 0.0, self._bus.end, unread=facts.unread_log_lines,
            problem=source.reader.problem, damages=tuple(source.reader.damages), clock_jumps=facts.clock_jumps)
        return Report(recording, tuple(self._pad(pad, pad_counts(facts.pad(pad.name))) for pad in self._pads),
                      self._nodes.reports(), self._bus.report(facts.can_frames))

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

    def _pad(self, pad: PadSettings, counts: Mapping[str, int]) -> PadReport:
        report = replace(
            self._records[pad.name].report(), node_ids=pad.node_ids, layout=Path(pad.layout.source).name,
            layout_sha256=sha256_of(config_path(pad.layout.source)), counts=counts,
            strangers=tuple(self._source.heard.strangers().get(pad.name, ())))
        contradiction = self._contradictions.get(pad.name)
        if self._any_device or contradiction is None and not report.strangers:
            return report
        return replace(report, contradiction=contradiction, are_of_others=True, touches=TouchList(), samples=(),
                       health=None)


def _taken(pads: Sequence[PadSettings]) -> frozenset[int]:
    return frozenset(tpdo.cob_id.of(pad.node_ids[tpdo.node]) for pad in pads for tpdo in pad.layout.tpdos) | {
        pad.layout.sync_cob_id for pad in pads}
