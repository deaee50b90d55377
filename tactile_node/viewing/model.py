"""The facts of a report; `report_page` makes HTML of them. None: not in this recording. Stamps are Unix time [s]."""

import heapq
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum, unique
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from tactile_node.assembly.frame_source import PadStatistics
from tactile_node.cia301.emergency import Emergency
from tactile_node.cia301.objects import PRODUCER_HEARTBEAT_TIME
from tactile_node.logs.damage import Damage
from tactile_node.logs.logged_set_up import Contradiction
from tactile_node.viewing.taxel_record import TaxelHealth
from tactile_node.viewing.touch import Sample, TouchList

KEPT_ENTRIES = 100  #: at each end
KEPT_GAPS = 50

Entry = TypeVar('Entry')


class Ends(Generic[Entry]):
    """The first and the last of many entries; what lies between is only counted, so that memory is bounded."""

    def __init__(self) -> None:
        self._first: list[Entry] = []
        self._last: deque[Entry] = deque(maxlen=KEPT_ENTRIES)
        self.count = 0

    def add(self, entry: Entry) -> None:
        self.count += 1
        (self._first if len(self._first) < KEPT_ENTRIES else self._last).append(entry)

    def __iter__(self) -> Iterator[Entry]:
        """Yield those that are kept, in their order."""
        return iter((*self._first, *self._last))

    def __len__(self) -> int:
        return len(self._first) + len(self._last)


class Gap(NamedTuple):
    """A time without what should have come."""

    seconds: float
    begin: float    #: stamp of the last one before


class LongestGaps:
    """The longest gaps, in their order in time; ``least``: shorter ones are none [s]."""

    def __init__(self, least: float):
        self._least = least
        self._kept: list[Gap] = []
        self._last: float | None = None
        self.count = 0

    def feed(self, stamp: float) -> None:
        """Something came at ``stamp``."""
        if self._last is not None and stamp - self._last >= self._least:
            self.count += 1
            keep = heapq.heappush if len(self._kept) < KEPT_GAPS else heapq.heappushpop
            keep(self._kept, Gap(stamp - self._last, self._last))
        self._last = stamp if self._last is None else max(self._last, stamp)

    def __iter__(self) -> Iterator[Gap]:
        return iter(sorted(self._kept, key=lambda gap: gap.begin))

    def __len__(self) -> int:
        return len(self._kept)


@unique
class Kind(Enum):
    """What was reported on."""

    CAN_FRAMES = 'CAN frames'
    TOPICS = 'ROS topics'
    BOTH = 'ROS topics and CAN frames'


@dataclass(frozen=True)
class ReportedFile:
    """The recording, as far as it could be read."""

    name: str          #: without its folder
    size: int          #: bytes, of all files of a bag
    sha256: str        #: of a file; '' for several
    kind: Kind
    begin: float
    end: float
    unread: int = 0    #: lines, messages or rests that could not be read
    problem: str = ''  #: the last of these
    clock_jumps: int = 0
    damages: tuple[Damage, ...] = ()  #: of a bag or a series of files


@dataclass(frozen=True)
class PadReport:
    """One pad."""

    name: str
    rows: int
    cols: int
    pitch: float                          #: [m]
    unit: str
    frames: int                           #: taxel frames in the recording
    incomplete: int                       #: of these, with missing CAN frames
    lost_frames: int                      #: taxel frames that were lost, by gaps in their sequence
    period: float | None                  #: median time between two frames [s]
    gaps: LongestGaps                     #: between taxel frames
    touches: TouchList
    samples: tuple[Sample, ...]
    health: TaxelHealth | None            #: None: no frame
    node_ids: tuple[int, ...] = ()        #: empty: not in this recording
    layout: str | None = None             #: its name
    layout_sha256: str | None = None
    statistics: PadStatistics | None = None
    losses: tuple[tuple[str, int], ...] | None = None  #: CAN frames lost, by reason
    contradiction: Contradiction | None = None  #: the log is of another device: no taxel is given
    strangers: tuple[int, ...] = ()       #: nodes heard that send its COB-IDs, while its own were not
    are_of_others: bool = False           #: for one of these reasons its taxels may be wrong, and are left out


class NmtChange(NamedTuple):
    stamp: float
    state: int       #: by its heartbeat; 0: boot-up


class Reported(NamedTuple):
    """A sentence of the driver, from SkinStatus or /diagnostics."""

    stamp: float
    text: str
    is_problem: bool  #: a warning or an error; else it is over, or a change


@dataclass
class NodeReport:
    """One CANopen node, whether a pad has it or not."""

    node_id: int
    pad: str | None                 #: None: of no pad
    #: index, sub-index: values read by SDO, each once
    objects: dict[tuple[int, int], tuple[bytes, ...]] = field(default_factory=dict)
    emergencies: Ends[Emergency | Reported] = field(default_factory=Ends)
    nmt: Ends[NmtChange] = field(default_factory=Ends)
    heartbeats: int | None = None
    longest_pause: float | None = None  #: between two heartbeats [s]

    @property
    def identity(self) -> dict[tuple[int, int], tuple[bytes, ...]]:
        """The objects that only change when the device does: not what can be written."""
        return {key: values for key, values in self.objects.items() if key[0] != PRODUCER_HEARTBEAT_TIME}


class SeenCommand(NamedTuple):
    """An NMT command on the bus."""

    stamp: float
    command: int
    node_id: int  #: 0: all


@dataclass(frozen=True)
class LoadCurve:
    """By windows of ``window`` s, with bit stuffing at its worst; of a time without CAN frames only its ends."""

    window: float
    stamps: np.ndarray
    bit_rates: np.ndarray | None    #: bits per second on the bus; None: only the share is known
    shares: np.ndarray | None       #: of the bus's bit rate; None: that is not known
    mean: float                     #: over the whole recording: share, or where that is not known, bits per second


@dataclass(frozen=True)
class BusReport:
    """The CAN bus. Fields are None where the recording has no CAN frames."""

    load: LoadCurve | None
    reported: Ends[Reported] | None = None  #: changes of what driver and nodes report of themselves
    can_frames: dict[str, int] | None = None   #: by service; read only
    gaps: LongestGaps | None = None         #: without any CAN frame
    commands: Ends[SeenCommand] | None = None
    channels: tuple[str, ...] = ()          #: names of the buses, as the log has them, or topics of CAN frames


@dataclass(frozen=True)
class Report:
    """Everything on the page."""

    versions: tuple[tuple[str, str], ...]
    recording: ReportedFile
    pads: tuple[PadReport, ...]
    nodes: tuple[NodeReport, ...] | None
    bus: BusReport
