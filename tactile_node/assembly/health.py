"""The state of a bus and its nodes at one moment, as facts; ``fault_text`` makes sentences of them."""

from dataclasses import dataclass
from enum import unique
from typing import Generic, NamedTuple, TypeVar

from tactile_node.cia301.emergency import DeviceErrors, Emergency
from tactile_node.code_names import PhrasedCode


class Fault(PhrasedCode):
    """A fault; the first two codes are not known and none."""

    @property
    def is_fault(self) -> bool:
        return self.value not in (0, 1)


@unique
class NodeFault(Fault):
    """The fault of a CANopen node; the codes are those of NodeStatus.msg."""

    NOT_KNOWN = 0, 'its state is not known yet'
    NONE = 1, 'no fault'
    BOOTED = 2, 'it has started again (power cycle or reset) and is not configured yet'
    UNCONFIGURED = 3, 'it has not been configured since the bus was opened'
    SILENT = 4, 'it sends neither heartbeat nor taxels'
    NO_HEARTBEAT = 5, 'it sends taxels but no heartbeat'
    NOT_OPERATIONAL = 6, 'it is not OPERATIONAL'
    NO_SYNC = 7, 'it waits for SYNC, which no other device sends'
    NO_TAXELS = 8, 'it is OPERATIONAL but sends no usable taxels'
    AWAITING_TAXELS = 9, 'its taxels are not back yet'
    RECONFIGURED = 10, 'another CANopen master has changed its TPDOs'
    TPDO_MISSING = 11, 'some of its TPDOs bring no taxels'
    TWO_SENDERS = 12, 'two devices send under its node-ID or its COB-IDs'


@unique
class BusFault(Fault):
    """Why a bus or a log gives no taxels; the codes are those of SkinStatus.msg."""

    NOT_KNOWN = 0, 'the fault is not known'
    NONE = 1, 'no fault'
    NOT_OPENED = 2, 'the CAN bus cannot be opened'
    RECEPTION_FAILED = 3, 'the CAN bus cannot receive'
    SENDING_FAILED = 4, 'the CAN bus cannot send'
    BUS_OFF = 5, 'the CAN controller is bus-off'
    LOG_UNUSABLE = 6, 'the log cannot be used'
    DEVICE_ABSENT = 7, 'a device does not answer'
    DEVICE_UNUSABLE = 8, 'a device cannot be used'
    WRONG_CONFIGURATION = 9, 'the configuration cannot be used'
    INTERNAL_ERROR = 10, 'internal error'


@unique
class SyncFault(Fault):
    """What is wrong with SYNC on the bus; the codes are those of SkinStatus.msg."""

    NOT_KNOWN = 0, 'SYNC is not evaluated yet'
    NONE = 1, 'no fault'
    SECOND_PRODUCER = 2, 'another device sends SYNC, too'
    OTHER_PERIOD = 3, 'SYNC comes with another period than sync_period'


@unique
class Overload(Fault):
    """Why this process is too slow; the codes are those of SkinStatus.msg."""

    NOT_KNOWN = 0, 'it is not evaluated yet'
    NONE = 1, 'it keeps up'
    STALLED = 2, 'it did not run for a while'
    BEHIND = 3, 'CAN frames wait too long until they are processed'
    DROPPED = 4, 'CAN frames are lost because too many wait'


class SyncState(NamedTuple):
    """SYNC as it is received."""

    fault: SyncFault = SyncFault.NOT_KNOWN
    foreign: int = 0              #: SYNCs of other devices while this driver produces SYNC
    period: float | None = None   #: measured, where another device produces SYNC [s]


class SentTpdo(NamedTuple):
    """A TPDO of a node as it is on the bus."""

    number: int  #: 1 is that of 0x1800
    can_id: int


class TpdoOrder(NamedTuple):
    """A node sends its TPDOs in another order than the layout says. TPDOs by name: see ``TpdoLayout.name``."""

    node_id: int
    sent: tuple[str, ...]
    layout: tuple[str, ...]


class Failure(NamedTuple):
    """The fault of a bus or a log, and what the adapter, device or system reported."""

    fault: BusFault
    detail: str = ''


#: What causes an outage: a bus has a failure; a node has a fault, or its bus has a failure
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
    tpdo_order: TpdoOrder | None = None  #: where it is another one than the layout's
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
    last_command: ForeignCommand | None = None  #: sent by another master
    sync: SyncState = SyncState()
    overload: Overload = Overload.NOT_KNOWN  #: what seems to be missing may only not be processed yet
    stalls: int = 0  #: times this process did not run for long

    @property
    def fault(self) -> BusFault:
        return BusFault.NONE if self.failure is None else self.failure.fault
