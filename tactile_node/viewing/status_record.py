"""What the driver reported of itself in a bag: SkinStatus, or where there is none, /diagnostics.

Its counts begin when it was configured; those of a report are of the recording, so the first message is taken off.
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import numpy as np

from tactile_node.conditioning.tare import rest_limit
from tactile_node.conditioning.taxel_faults import FaultDetector, TaxelFault
from tactile_node.read_only import read_only
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus
from tactile_node.viewing.model import BusLoad, Ends, NmtChange, NodeFacts, Reported, TaxelHealth

STATUSES = len(TaxelStatus)


class TaxelRecord:
    """Record of one pad's taxels; its frames have one shape (rows, cols)."""

    def __init__(self, rows: int, cols: int, unit: str):
        self._by_status = np.zeros((STATUSES, rows * cols), np.int64)
        self._places = np.arange(rows * cols)
        self._lowest = np.full((rows, cols), np.nan)
        self._highest = np.full((rows, cols), np.nan)
        self._detector = FaultDetector(rows, cols, rest_limit(0.0, unit))
        self._frames = 0

    def feed(self, frame: TaxelFrame) -> None:
        self._frames += 1
        self._by_status[frame.status.reshape(-1), self._places] += 1
        self._lowest = np.fmin(self._lowest, frame.values)
        self._highest = np.fmax(self._highest, frame.values)
        self._detector.update(frame.stamp, frame.values, 0.0, frame.status == TaxelStatus.SATURATED)

    def health(self) -> TaxelHealth:
        return TaxelHealth(frames=self._frames, by_status=read_only(self._by_status.reshape(-1, *self._lowest.shape)),
                           lowest=read_only(self._lowest), highest=read_only(self._highest),
                           faults=self._detector.faults.kinds)


class Mark(IntEnum):
    """The worst that is known of a taxel; a later one prevails."""

    GOOD = 0           #: had a value in every frame, which changed
    NEVER_CHANGED = 1  #: an untouched taxel of a quiet skin does not either
    SATURATED = 2      #: at the end of its range in some frames
    SOME_MISSING = 3   #: without a value in some frames
    NO_VALUE = 4       #: without a value in every frame
    FLICKERING = 5
    STUCK = 6          #: also at the end of its range
    DEAD = 7           #: by what it sent, by the layout or the driver
    UNMAPPED = 8       #: no place of a taxel


def no_value_share(health: TaxelHealth) -> np.ndarray:
    """Return, for each taxel, the share of frames without a value; NaN where there is no taxel. (rows, cols)."""
    valued = health.by_status[[TaxelStatus.VALID, TaxelStatus.SATURATED]].sum(0)
    share: np.ndarray = 1 - valued / max(1, health.frames)
    return np.where(health.by_status[TaxelStatus.UNMAPPED] == health.frames, np.nan, share)


def marks_of(health: TaxelHealth) -> np.ndarray:
    """Return the Mark of each taxel, uint8, (rows, cols)."""
    missing, faults, counts = no_value_share(health), health.faults, health.by_status
    marks = np.zeros(missing.shape, np.uint8)
    for mark, places in (
            (Mark.NEVER_CHANGED, health.never_changed),
            (Mark.SATURATED, counts[TaxelStatus.SATURATED] > 0),
            (Mark.SOME_MISSING, missing > 0),
            (Mark.NO_VALUE, missing == 1),
            (Mark.FLICKERING, faults == TaxelFault.FLICKERING),
            (Mark.STUCK, (faults == TaxelFault.STUCK) | (faults == TaxelFault.SATURATED)
             | (counts[TaxelStatus.FAULTY] > 0)),
            (Mark.DEAD, (faults == TaxelFault.DEAD) | (counts[TaxelStatus.DEAD] > 0)),
            (Mark.UNMAPPED, np.isnan(missing))):
        marks[places] = mark
    return marks


OK = 1                            #: SkinStatus, PadStatus; NOT_KNOWN is 0
NMT_NOT_KNOWN, NMT_BOOT_UP = 0, 1  #: NodeStatus
BOOT_UP = 0                       #: CiA 301
PERIOD = 1.0                      #: s between two SkinStatus


class StatusRecord:
    """Takes the messages of one bag in turn."""

    def __init__(self) -> None:
        self._levels: dict[str, tuple[int, str]] = {}
        self._reported: Ends[Reported] = Ends()
        self._loads: list[tuple[float, float]] = []
        self._nodes: dict[int, _ReportedNode] = {}
        self._losses: dict[str, _Counts] = {}
        self.has_status = False
        self.has_diagnostics = False

    def feed_status(self, stamp: float, status: Any) -> None:
        """A SkinStatus."""
        self.has_status = True
        self._loads.append((stamp, float(status.bus_load)))
        self._report(stamp, 'bus', status.level - OK, status.failure or status.message)
        for pad in status.pads:
            self._report(stamp, f'pad {pad.pad}', pad.level - OK, pad.message)
            counts = dict(zip(pad.loss_reasons, map(int, pad.loss_counts)))
            self._losses.setdefault(pad.pad, _Counts()).feed(counts)
            for node in pad.nodes:
                self._nodes.setdefault(node.node_id, _ReportedNode(pad.pad)).feed(stamp, node)
                self._report(stamp, f'node {node.node_id}', int(bool(node.fault_text)), node.fault_text)

    def feed_diagnostics(self, stamp: float, diagnostics: Any) -> None:
        """A DiagnosticArray, of any program."""
        self.has_diagnostics = True
        for status in diagnostics.status:
            level = status.level if isinstance(status.level, int) else status.level[0]
            self._report(stamp, status.name, level, status.message)

    @property
    def reported(self) -> tuple[Reported, ...] | None:
        """Changes of level or text; None without a message."""
        return self._reported.kept() if self.has_status or self.has_diagnostics else None

    def load(self) -> BusLoad | None:
        if not self._loads:
            return None
        stamps, shares = np.array(self._loads).T
        return BusLoad(PERIOD, read_only(stamps), None, read_only(shares), float(shares.mean()))

    def losses(self, pad: str) -> tuple[tuple[str, int], ...] | None:
        """CAN frames lost within the recording, by reason; ``pad`` may have its namespace before it."""
        counts = self._losses.get(pad.rpartition('/')[2])
        return None if counts is None else counts.within()

    def nodes(self) -> tuple[NodeFacts, ...] | None:
        """None without a SkinStatus that has nodes."""
        return tuple(node.facts(node_id) for node_id, node in sorted(self._nodes.items())) or None

    def pads_of_nodes(self) -> list[tuple[str, tuple[int, ...]]]:
        """The pads and their node-IDs, as far as a SkinStatus has them."""
        return [(node.pad, (node_id,)) for node_id, node in sorted(self._nodes.items())]

    def _report(self, stamp: float, where: str, level: int, message: str) -> None:
        before = self._levels.get(where)
        if before == (level, message) or before is None and level <= 0:
            self._levels[where] = level, message
            return
        self._levels[where] = level, message
        if level > 0 or before is not None and before[0] > 0:
            self._reported.add(Reported(stamp, f'{where}: {message or "no fault"}', level > 0))


class _Counts:
    """Counts that only rise, until their program starts again."""

    def __init__(self) -> None:
        self._first: Mapping[str, int] = {}
        self._last: Mapping[str, int] | None = None
        self._before: dict[str, int] = {}  # of the runs before this one

    def feed(self, counts: Mapping[str, int]) -> None:
        if self._last is None:
            self._first = counts
        elif any(count < self._last.get(reason, 0) for reason, count in counts.items()):
            self._before, self._first = dict(self.within()), {}
        self._last = counts

    def within(self) -> tuple[tuple[str, int], ...]:
        last = self._last or {}
        total = {reason: self._before.get(reason, 0) + last.get(reason, 0) - self._first.get(reason, 0)
                 for reason in {**self._before, **last}}
        return tuple((reason, count) for reason, count in total.items() if count)


class _ReportedNode:
    def __init__(self, pad: str) -> None:
        self.pad = pad
        self._nmt: Ends[NmtChange] = Ends()
        self._state: int | None = None
        self._emergencies: Ends[Reported] = Ends()
        self._count: int | None = None
        self._sent = 0

    def feed(self, stamp: float, node: Any) -> None:
        state = {NMT_NOT_KNOWN: None, NMT_BOOT_UP: BOOT_UP}.get(node.nmt_state, node.nmt_state)
        if state is not None and state != self._state:
            self._nmt.add(NmtChange(stamp, state))
        self._state = state
        new = 0 if self._count is None else node.emcy_count - self._count
        new = new if new >= 0 else node.emcy_count  # the driver has started again
        if new:
            self._sent += new
            self._emergencies.add(Reported(stamp, node.emcy_last, bool(node.emcy_active)))
        self._count = node.emcy_count

    def facts(self, node_id: int) -> NodeFacts:
        return NodeFacts(node_id=node_id, pad=self.pad, objects={}, emergencies=self._emergencies.kept(),
                         emergency_count=self._sent, nmt=self._nmt.kept(), nmt_count=self._nmt.count, heartbeats=None,
                         longest_pause=None)
