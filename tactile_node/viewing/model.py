"""Data of a report, which `report_page` renders as HTML.

A field is None if the recording does not contain its value. Stamps are Unix time [s].
"""

import heapq
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from tactile_node.cia301.objects import PRODUCER_HEARTBEAT_TIME, NmtState, state_name
from tactile_node.logs.logged_set_up import Contradiction
from tactile_node.viewing.reported_file import ReportedFile
from tactile_node.viewing.taxel_record import TaxelHealth
from tactile_node.viewing.touch import Sample, TouchList

KEPT_ENTRIES = 100  #: number of entries kept at each end
KEPT_GAPS = 50      #: maximum number of gaps kept

Entry = TypeVar('Entry')


class Ends(Generic[Entry]):
    """Keeps the first and last entries of a sequence. Other entries are only counted, so that memory stays bounded."""

    def __init__(self) -> None:
        self._first: list[Entry] = []
        self._last: deque[Entry] = deque(maxlen=KEPT_ENTRIES)
        self.count = 0

    def add(self, entry: Entry) -> None:
        self.count += 1
        (self._first if len(self._first) < KEPT_ENTRIES else self._last).append(entry)

    def __iter__(self) -> Iterator[Entry]:
        """Yield the kept entries in order."""
        return iter((*self._first, *self._last))

    def __len__(self) -> int:
        return len(self._first) + len(self._last)


class Gap(NamedTuple):
    """An interval without the expected events."""

    seconds: float  #: length [s]
    begin: float    #: stamp of the last event before the gap


class LongestGaps:
    """Keeps the longest gaps between events, in chronological order. Gaps shorter than ``least`` [s] are ignored."""

    def __init__(self, least: float):
        self._least = least
        self._kept: list[Gap] = []
        self._last: float | None = None
        self.count = 0

    def feed(self, stamp: float) -> None:
        """Record an event at ``stamp``."""
        if self._last is not None and stamp - self._last >= self._least:
            self.count += 1
            keep = heapq.heappush if len(self._kept) < KEPT_GAPS else heapq.heappushpop
            keep(self._kept, Gap(stamp - self._last, self._last))
        self._last = stamp if self._last is None else max(self._last, stamp)

    def __iter__(self) -> Iterator[Gap]:
        return iter(sorted(self._kept, key=lambda gap: gap.begin))

    def __len__(self) -> int:
        return len(self._kept)


@dataclass(frozen=True)
class PadReport:
    """Facts about one pad."""

    name: str
    rows: int
    cols: int
    pitch: float                          #: [m]
    unit: str
    frames: int                           #: number of taxel frames in the recording
    incomplete: int                       #: number of taxel frames with missing CAN frames
    lost_frames: int                      #: number of lost taxel frames, derived from gaps in the sequence numbers
    period: float | None                  #: median time between two frames [s]
    gaps: LongestGaps                     #: gaps between taxel frames
    touches: TouchList
    samples: tuple[Sample, ...]
    health: TaxelHealth | None            #: statistics of the taxels, or None without a taxel frame
    node_ids: tuple[int, ...] = ()        #: node-IDs of the pad, or empty if the recording does not contain them
    layout: str | None = None             #: name of the layout
    layout_sha256: str | None = None
    counts: Mapping[str, int] | None = None  #: `pad_counts` within the recording
    #: evidence that the log comes from another device; with such evidence, no taxels are reported
    contradiction: Contradiction | None = None
    #: other nodes that send the pad's COB-IDs, listed if the pad's own nodes were not heard
    strangers: tuple[int, ...] = ()
    #: True if the taxels are omitted because they may belong to another pad or device
    are_of_others: bool = False


class ReportedEvent(NamedTuple):
    """An NMT state change, an NMT command, an EMCY, or a message from the driver."""

    stamp: float
    text: str
    is_problem: bool = False  #: True for a warning or an error


@dataclass
class NodeReport:
    """Facts about one CANopen node, whether or not it belongs to a pad."""

    node_id: int
    #: name of the pad, or None if the node belongs to no pad
    pad: str | None
    #: distinct values read by SDO, by index and sub-index
    objects: dict[tuple[int, int], tuple[bytes, ...]] = field(default_factory=dict)
    emergencies: Ends[ReportedEvent] = field(default_factory=Ends)
    nmt: Ends[ReportedEvent] = field(default_factory=Ends)
    restarts: int = 0                   #: number of boot-ups after the first NMT state
    heartbeats: int | None = None
    longest_pause: float | None = None  #: longest time between two heartbeats [s]

    def add_state(self, stamp: float, state: int) -> None:
        """Add a change to the NMT ``state``."""
        self.restarts += state == NmtState.BOOT_UP and self.nmt.count > 0
        self.nmt.add(ReportedEvent(stamp, state_name(state)))

    @property
    def identity(self) -> dict[tuple[int, int], tuple[bytes, ...]]:
        """Read-only objects of the device, whose values change only if the device is replaced."""
        return {key: values for key, values in self.objects.items() if key[0] != PRODUCER_HEARTBEAT_TIME}


@dataclass(frozen=True)
class LoadCurve:
    """Bus load in windows of ``window`` seconds, assuming worst-case bit stuffing.

    An interval without CAN frames is stored as its first and last window only.
    """

    window: float
    stamps: np.ndarray
    bit_rates: np.ndarray | None    #: bits per second on the bus, or None if only ``shares`` are known
    shares: np.ndarray | None       #: load as a fraction of the bus's bit rate, or None if the bit rate is unknown
    mean: float  #: mean over the recording: a fraction if the bit rate is known, else bits per second


@dataclass(frozen=True)
class BusReport:
    """Facts about the CAN bus. Fields derived from CAN frames are None if the recording has no CAN frames."""

    load: LoadCurve | None
    reported: Ends[ReportedEvent] | None = None  #: status changes reported by the driver
    can_frames: Mapping[str, int] | None = None  #: number of CAN frames by CANopen service
    gaps: LongestGaps | None = None         #: gaps without any CAN frame
    commands: Ends[ReportedEvent] | None = None
    channels: tuple[str, ...] = ()          #: names of the buses in the log, or topics with CAN frames


@dataclass(frozen=True)
class Report:
    """All data shown on the report page."""

    recording: ReportedFile
    pads: tuple[PadReport, ...]
    nodes: tuple[NodeReport, ...] | None
    bus: BusReport
