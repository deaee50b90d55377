"""The facts of a report; `page` makes HTML of them. None: not in this recording. Stamps are Unix time [s]."""

import heapq
from collections import deque
from dataclasses import dataclass
from enum import Enum, unique
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from tactile_node.assembly.frame_source import PadStatistics
from tactile_node.cia301.emergency import Emergency
from tactile_node.cia301.objects import PRODUCER_HEARTBEAT_TIME
from tactile_node.logs.damage import Damage
from tactile_node.logs.logged_set_up import Contradiction
from tactile_node.taxel_frame import TaxelStatus
from tactile_node.viewing.touch import Sample, Touch


@unique
class Kind(Enum):
    """What was reported on."""

    CAN_FRAMES = 'CAN frames'
    TOPICS = 'ROS topics'
    BOTH = 'ROS topics and CAN frames'


class Gap(NamedTuple):
    """A time without what should have come."""

    begin: float    #: stamp of the last one before
    seconds: float


@dataclass(frozen=True)
class Recording:
    """The file, as far as it could be read."""

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
class TaxelHealth:
    """Counts by taxel over all frames; arrays are read-only, (rows, cols)."""

    frames: int
    by_status: np.ndarray      #: int, (TaxelStatus, rows, cols): frames in which the taxel had this status
    lowest: np.ndarray         #: least value; NaN: never had one
    highest: np.ndarray
    faults: np.ndarray         #: uint8 TaxelFault, by what it sent

    @property
    def never_changed(self) -> np.ndarray:
        """Bool: had a value in two frames or more, and always the same."""
        valued: np.ndarray = self.by_status[[TaxelStatus.VALID, TaxelStatus.SATURATED]].sum(0) >= 2
        return valued & (self.lowest == self.highest)


@dataclass(frozen=True)
class PadFacts:
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
    gaps: tuple[Gap, ...]                 #: between taxel frames, the longest
    gap_count: int
    touches: tuple[Touch, ...]
    touches_left_out: int                 #: beyond the most that are listed
    small_frames: int                     #: with contacts of too few taxels for a touch alone
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


@dataclass(frozen=True)
class NodeFacts:
    """One CANopen node, whether a pad has it or not."""

    node_id: int
    pad: str | None                             #: None: of no pad
    objects: dict[tuple[int, int], tuple[bytes, ...]]  #: index, sub-index: values read by SDO, each once; read only
    emergencies: tuple[Emergency | Reported, ...]  #: the first and the last of them
    emergency_count: int | None                 #: None: not in this recording
    nmt: tuple[NmtChange, ...]
    nmt_count: int | None
    heartbeats: int | None
    longest_pause: float | None                 #: between two heartbeats [s]

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
class BusLoad:
    """By windows of ``window`` s, with bit stuffing at its worst; of a time without CAN frames only its ends."""

    window: float
    stamps: np.ndarray
    bit_rates: np.ndarray | None    #: bits per second on the bus; None: only the share is known
    shares: np.ndarray | None       #: of the bus's bit rate; None: that is not known
    mean: float                     #: over the whole recording: share, or where that is not known, bits per second


@dataclass(frozen=True)
class BusFacts:
    """The CAN bus. Fields are None where the recording has no CAN frames."""

    can_frames: dict[str, int] | None      #: by service; read only
    load: BusLoad | None
    gaps: tuple[Gap, ...] | None           #: without any CAN frame, the longest
    gap_count: int | None
    commands: tuple[SeenCommand, ...] | None
    command_count: int | None
    reported: tuple[Reported, ...] | None  #: changes of what driver and nodes report of themselves
    channels: tuple[str, ...] = ()         #: names of the buses, as the log has them, or topics of CAN frames


@dataclass(frozen=True)
class Report:
    """Everything on the page."""

    versions: tuple[tuple[str, str], ...]
    recording: Recording
    pads: tuple[PadFacts, ...]
    nodes: tuple[NodeFacts, ...] | None
    bus: BusFacts


KEPT = 100  #: at each end

Entry = TypeVar('Entry')


class Ends(Generic[Entry]):
    """Bounds the memory that a device which repeats itself can take; what lies between is only counted."""

    def __init__(self) -> None:
        self._first: list[Entry] = []
        self._last: deque[Entry] = deque(maxlen=KEPT)
        self.count = 0

    def add(self, entry: Entry) -> None:
        self.count += 1
        if len(self._first) < KEPT:
            self._first.append(entry)
        else:
            self._last.append(entry)

    def kept(self) -> tuple[Entry, ...]:
        """In their order."""
        return (*self._first, *self._last)


KEPT_GAPS = 50


class LongestGaps:
    """``least``: shorter ones are none [s]."""

    def __init__(self, least: float):
        self._least = least
        self._kept: list[tuple[float, float]] = []  # seconds, begin
        self._last: float | None = None
        self.count = 0

    def feed(self, stamp: float) -> None:
        """Something came at ``stamp``."""
        if self._last is not None and stamp - self._last >= self._least:
            self.count += 1
            entry = stamp - self._last, self._last
            (heapq.heappush if len(self._kept) < KEPT_GAPS else heapq.heappushpop)(self._kept, entry)
        self._last = stamp if self._last is None else max(self._last, stamp)

    def gaps(self) -> tuple[Gap, ...]:
        """In their order in time."""
        return tuple(sorted(Gap(begin, seconds) for seconds, begin in self._kept))
