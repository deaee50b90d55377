"""Collect the driver's status reports from a bag.

The driver's counters start when the driver is configured. The report covers only the recording, so the counts in the
first message are subtracted.
"""

from collections import Counter
from typing import Any

import numpy as np

from tactile_node.assembly.facts import pad_counts
from tactile_node.cia301.objects import NmtState
from tactile_node.taxel_frame import read_only
from tactile_node.viewing.levels import OK
from tactile_node.viewing.model import BusReport, Ends, LoadCurve, NodeReport, ReportedEvent

NMT_NOT_KNOWN = 0                       #: value of NodeStatus.nmt_state
NMT_BOOT_UP = 1                         #: value of NodeStatus.nmt_state
STATUS_PERIOD = 1.0               #: time between two SkinStatus messages [s]


class StatusRecord:
    """Processes the status messages of one bag in order."""

    def __init__(self) -> None:
        self._levels: dict[str, tuple[int, str]] = {}
        self._reported: Ends[ReportedEvent] = Ends()
        self._loads: list[tuple[float, float]] = []
        self._nodes: dict[int, _ReportedNode] = {}
        self._last: dict[str, Counter[str]] = {}  # counters of each pad in its last message
        self._within: dict[str, Counter[str]] = {}  # counters of each pad within the recording

    def feed(self, stamp: float, status: Any) -> None:
        """Process a SkinStatus."""
        self._loads.append((stamp, float(status.bus_load)))
        self._report(stamp, 'bus', status.level - OK, status.failure or status.message)
        for pad in status.pads:
            self._report(stamp, f'pad {pad.pad}', pad.level - OK, pad.message)
            self._count(pad.pad, pad_counts(pad))
            for node in pad.nodes:
                self._nodes.setdefault(node.node_id, _ReportedNode(node.node_id, pad.pad)).feed(stamp, node)
                self._report(stamp, f'node {node.node_id}', int(bool(node.fault_text)), node.fault_text)

    def bus(self) -> BusReport:
        """Return the facts about the bus. ``reported`` holds changes of level or text, or None without messages."""
        if not self._loads:
            return BusReport(None)
        stamps, shares = np.array(self._loads).T
        load = LoadCurve(STATUS_PERIOD, read_only(stamps), None, read_only(shares), float(shares.mean()))
        return BusReport(load, self._reported)

    def counts(self, pad: str) -> Counter[str] | None:
        """Return the counters within the recording, or None without messages. ``pad`` may include a namespace."""
        return self._within.get(pad.rpartition('/')[2])

    def nodes(self) -> tuple[NodeReport, ...] | None:
        """Return the nodes of the pads, or None if no SkinStatus names a node."""
        return tuple(node.report for _, node in sorted(self._nodes.items())) or None

    def _count(self, pad: str, counts: Counter[str]) -> None:
        new = counts.copy()
        new.subtract(self._last.get(pad, counts))
        if min(new.values()) < 0:  # counters decrease only when the driver restarts, which sets them to 0
            new = counts
        self._last[pad] = counts
        self._within.setdefault(pad, Counter()).update(new)

    def _report(self, stamp: float, where: str, level: int, message: str) -> None:
        before, now = self._levels.get(where, (0, '')), (level, message)
        self._levels[where] = now
        if before != now and (level > 0 or before[0] > 0):
            self._reported.add(ReportedEvent(stamp, f'{where}: {message or "no fault"}', level > 0))


class _ReportedNode:
    def __init__(self, node_id: int, pad: str) -> None:
        self.report = NodeReport(node_id, pad)
        self._state: int | None = None
        self._count: int | None = None

    def feed(self, stamp: float, node: Any) -> None:
        state = {NMT_NOT_KNOWN: None, NMT_BOOT_UP: NmtState.BOOT_UP}.get(node.nmt_state, node.nmt_state)
        if state is not None and state != self._state:
            self.report.add_state(stamp, state)
        self._state = state
        new = 0 if self._count is None else node.emcy_count - self._count
        new = new if new >= 0 else node.emcy_count  # the counter fell because the driver restarted
        if new:
            self.report.emergencies.add(ReportedEvent(stamp, node.emcy_last, bool(node.emcy_active)))
            self.report.emergencies.count += new - 1  # a NodeStatus holds only the last EMCY
        self._count = node.emcy_count
