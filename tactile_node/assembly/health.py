"""The state of a bus and its nodes at one moment, as facts; ``fault_text`` makes sentences of them."""

from dataclasses import dataclass
from enum import Enum, unique
from typing import Generic, NamedTuple, TypeVar

from tactile_node.cia301.emergency import DeviceErrors, Emergency


@unique
class NodeFault(Enum):
    """The fault of a CANopen node; the codes are those of NodeStatus.msg."""

    NOT_KNOWN = 0        #: not evaluated yet
    NONE = 1
    BOOTED = 2           #: it has started again since it was configured
    UNCONFIGURED = 3     #: it has not been configured since the bus was opened
    SILENT = 4           #: neither heartbeat nor taxels
    NO_HEARTBEAT = 5     #: taxels without heartbeat
    NOT_OPERATIONAL = 6  #: its NMT state is another
    NO_SYNC = 7          #: the device that produces SYNC sends none
    NO_TAXELS = 8        #: OPERATIONAL without usable taxels
    AWAITING_TAXELS = 9  #: its outage has not ended yet, though nothing else is wrong with it
    RECONFIGURED = 10    #: another master has written to its TPDO configuration
    TPDO_MISSING = 11    #: some of its TPDOs bring no taxels, others do
    TWO_SENDERS = 12     #: a second device sends under its node-ID or its COB-IDs

    @property
    def is_fault(self) -> bool:
        return self not in (NodeFault.NOT_KNOWN, NodeFault.NONE)


@unique
class BusFault(Enum):
    """Why a bus or a log gives no taxels; the codes are those of SkinStatus.msg."""

    NOT_KNOWN = 0
    NONE = 1
    NOT_OPENED = 2           #: the CAN bus cannot be opened
    RECEPTION_FAILED = 3     #: the adapter is gone, the network is down
    SENDING_FAILED = 4       #: the adapter takes no more CAN frames
    BUS_OFF = 5              #: the CAN controller has switched itself off (ISO 11898-1)
    LOG_UNUSABLE = 6         #: a replayed log is missing, damaged, of two buses or of other devices
    DEVICE_ABSENT = 7        #: a device did not answer when it was to be configured
    DEVICE_UNUSABLE = 8      #: a device is another one or refuses its configuration
    WRONG_CONFIGURATION = 9  #: a parameter, layout or EDS cannot be used
    INTERNAL_ERROR = 10      #: a defect of this software; the log has its traceback


@unique
class SyncFault(Enum):
    """What is wrong with SYNC on the bus; the codes are those of SkinStatus.msg."""

    NOT_KNOWN = 0        #: not evaluated yet, or a log
    NONE = 1
    SECOND_PRODUCER = 2  #: another device sends SYNC, too, while this driver does
    OTHER_PERIOD = 3     #: the device that produces SYNC has another period than ``sync_period``

    @property
    def is_fault(self) -> bool:
        return self not in (SyncFault.NOT_KNOWN, SyncFault.NONE)


@unique
class Overload(Enum):
    """Why this process is too slow; the codes are those of SkinStatus.msg."""

    NOT_KNOWN = 0  #: not evaluated yet, or a log
    NONE = 1
    STALLED = 2    #: it did not run for a while
    BEHIND = 3     #: CAN frames wait for long until they are assembled
    DROPPED = 4    #: so many wait that CAN frames were dropped

    @property
    def is_overload(self) -> bool:
        return self not in (Overload.NOT_KNOWN, Overload.NONE)


class SyncState(NamedTuple):
    """SYNC as it is received."""

    fault: SyncFault = SyncFault.NOT_KNOWN
    foreign: int = 0              #: SYNCs of other devices while this driver produces SYNC
    period: float | None = None   #: of another producer, as measured [s]


class SentTpdo(NamedTuple):
    """A TPDO of a node as it is on the bus."""

    number: int  #: 1 is that of 0x1800
    can_id: int


class Failure(NamedTuple):
    """The fault of a bus or a log, and what the adapter, device or system reported."""

    fault: BusFault
    detail: str = ''


#: Of an outage: a bus has a failure; a node has a fault, or its bus has a failure
Cause = TypeVar('Cause', bound=Failure | NodeFault)


@dataclass(frozen=True)
class Outages(Generic[Cause]):
    """Times without taxels since construction, the one under way included."""

    count: int = 0
    seconds: float = 0.0
    cause: Cause | None = None  #: what began the last one
    current: Cause | None = None  #: why the one under way lasts; None: none is under way


class NodeHealth(NamedTuple):
    """One of a pad's nodes."""

    node_id: int
    state: int | None  #: NMT state as last received; None: never heard
    is_operational: bool  #: by a heartbeat that is not older than the timeout
    heartbeat_age: float | None  #: [s], None: none was received
    fault: NodeFault = NodeFault.NONE
    boots: int = 0  #: boot-up messages received
    emergencies: int = 0
    last_emergency: Emergency | None = None
    outages: Outages[Failure | NodeFault] = Outages()
    distrusted: int = 0  #: taxel frames given without values, because the node was not configured
    active_emergency: Emergency | None = None  #: the last error that it has not reset
    missing_tpdos: tuple[SentTpdo, ...] = ()  #: that bring no taxels, while others do
    surplus_tpdos: tuple[SentTpdo, ...] = ()  #: that are received more often than SYNC
    device_errors: DeviceErrors | None = None  #: that it listed when it refused to become OPERATIONAL


class ErrorCounters(NamedTuple):
    """Counters of the CAN controller (ISO 11898-1) in its last error frame: 96 warns, above 127 it is error-passive."""

    tx: int = 0
    rx: int = 0


class ForeignCommand(NamedTuple):
    """An NMT command (CiA 301) of another master."""

    command: int
    node_id: int  #: 0: all nodes


class BusHealth(NamedTuple):
    """``failure``: why nothing can be received, None while it can; ``nodes`` of each pad by name, none for a log."""

    failure: Failure | None = None
    is_active: bool = True  #: SYNC on, nodes are to be OPERATIONAL
    nodes: dict[str, tuple[NodeHealth, ...]] = {}  #: read only
    outages: Outages[Failure] = Outages()
    load: float = 0.0  #: part of the bus's time in use, bit stuffing at its worst, over the last second
    is_error_passive: bool = False
    error_counters: ErrorCounters = ErrorCounters()
    foreign_commands: int = 0
    last_command: ForeignCommand | None = None  #: of another master
    sync: SyncState = SyncState()
    overload: Overload = Overload.NOT_KNOWN  #: what seems to be missing may only not be processed yet
    stalls: int = 0  #: times this process did not run for long

    @property
    def fault(self) -> BusFault:
        return BusFault.NONE if self.failure is None else self.failure.fault
