"""Facts about the state of a bus and its nodes at one moment.

The module ``fault_text`` turns these facts into sentences.
"""

from dataclasses import dataclass
from enum import unique
from typing import Generic, NamedTuple, TypeVar

from tactile_node.cia301.emergency import DeviceErrors, Emergency
from tactile_node.code_names import PhrasedCode


class Fault(PhrasedCode):
    """A fault. Code 0 means that the fault is not known, and code 1 means that there is no fault."""

    @property
    def is_fault(self) -> bool:
        """True for every code except 0 (not known) and 1 (no fault)."""
        return self.value not in (0, 1)


@unique
class NodeFault(Fault):
    """The fault of a CANopen node. The codes are those of NodeStatus.msg."""

    NOT_KNOWN = 0, 'its state is not known yet'
    NONE = 1, 'no fault'
    BOOTED = 2, 'it has started again (power cycle or reset) and is not configured yet'
    UNCONFIGURED = 3, 'it has not been configured since the bus was opened'
    SILENT = 4, 'it sends neither heartbeat nor taxels'
    NO_HEARTBEAT = 5, 'it sends taxels but no heartbeat'
    NOT_OPERATIONAL = 6, 'it is not OPERATIONAL'
    NO_SYNC = 7, 'it waits for SYNC, but no device sends SYNC'
    NO_TAXELS = 8, 'it is OPERATIONAL but sends no usable taxels'
    AWAITING_TAXELS = 9, 'its taxels are not back yet'
    RECONFIGURED = 10, 'another CANopen master has changed its TPDOs'
    TPDO_MISSING = 11, 'some of its TPDOs bring no taxels'
    TWO_SENDERS = 12, 'two devices send with its node-ID or its COB-IDs'


@unique
class BusFault(Fault):
    """Reason why a bus or a log delivers no taxels. The codes are those of SkinStatus.msg."""

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
    """The fault of SYNC on the bus. The codes are those of SkinStatus.msg."""

    NOT_KNOWN = 0, 'SYNC is not evaluated yet'
    NONE = 1, 'no fault'
    SECOND_PRODUCER = 2, 'another device sends SYNC, too'
    OTHER_PERIOD = 3, 'the period of SYNC differs from sync_period'


@unique
class Overload(Fault):
    """Reason why this process is too slow. The codes are those of SkinStatus.msg."""

    NOT_KNOWN = 0, 'it is not evaluated yet'
    NONE = 1, 'it keeps up'
    STALLED = 2, 'it did not run for a while'
    BEHIND = 3, 'CAN frames wait too long until they are processed'
    DROPPED = 4, 'CAN frames are lost because too many wait'


class SyncState(NamedTuple):
    """State of the SYNC messages that the driver receives."""

    fault: SyncFault = SyncFault.NOT_KNOWN
    foreign: int = 0  #: SYNCs sent by other devices while this driver produces SYNC
    period: float | None = None  #: period measured while another device produces SYNC [s], else None


class SentTpdo(NamedTuple):
    """A TPDO of a node as it appears on the bus."""

    number: int  #: number of the TPDO; the communication record 0x1800 belongs to TPDO 1
    can_id: int  #: COB-ID


class TpdoOrder(NamedTuple):
    """Order of a node's TPDOs, by `TpdoLayout.name`, if the node does not send them in the order of the layout."""

    node_id: int
    sent: tuple[str, ...]  #: names in the order in which the node sends
    layout: tuple[str, ...]  #: names in the order of the layout


class Failure(NamedTuple):
    """The fault of a bus or a log."""

    fault: BusFault
    detail: str = ''  #: text from the adapter, the device or the operating system


#: Cause of an outage. A bus has an outage because of a failure. A node has an outage because of its own fault or a
#: failure of its bus.
Cause = TypeVar('Cause', bound=Failure | NodeFault)


@dataclass(frozen=True)
class Outages(Generic[Cause]):
    """Outages since construction.

    An outage is a time without taxels. The counts include an ongoing outage.
    """

    count: int = 0
    seconds: float = 0.0  #: total duration [s]
    cause: Cause | None = None  #: initial cause of the last outage
    current: Cause | None = None  #: present cause of an ongoing outage; None if there is no outage


class NodeHealth(NamedTuple):
    """State of one node of a pad."""

    node_id: int
    state: int | None  #: NMT state last received; None if none was received
    is_operational: bool  #: True if a heartbeat within the timeout reports OPERATIONAL
    heartbeat_age: float | None  #: time since the last heartbeat [s]; None if no heartbeat was received
    fault: NodeFault = NodeFault.NONE
    boots: int = 0  #: boot-up messages received
    emergencies: int = 0  #: EMCY messages received
    last_emergency: Emergency | None = None  #: last EMCY message
    outages: Outages[Failure | NodeFault] = Outages()
    distrusted: int = 0  #: taxel frames emitted without values because the node was not configured
    active_emergency: Emergency | None = None  #: last error that the device has not cleared yet
    missing_tpdos: tuple[SentTpdo, ...] = ()  #: TPDOs that deliver no taxels while other TPDOs of the node do
    surplus_tpdos: tuple[SentTpdo, ...] = ()  #: TPDOs that are received more often than SYNC
    tpdo_order: TpdoOrder | None = None  #: sending order of the TPDOs if it differs from the layout, else None
    device_errors: DeviceErrors | None = None  #: errors that the device reported when it failed to become OPERATIONAL


class ErrorCounters(NamedTuple):
    """Error counters of the CAN controller, taken from its last error frame (ISO 11898-1).

    The controller issues a warning at 96. Above 127, the controller is error-passive.
    """

    tx: int = 0  #: transmit error counter
    rx: int = 0  #: receive error counter


class ForeignCommand(NamedTuple):
    """An NMT command (CiA 301) from another master."""

    command: int  #: command specifier
    node_id: int  #: addressed node; 0 for all nodes


class BusHealth(NamedTuple):
    """State of a bus or a log."""

    failure: Failure | None = None  #: reason why nothing can be received; None if the bus works
    is_active: bool = True  #: True if SYNC is on and the nodes are expected to be OPERATIONAL
    nodes: dict[str, tuple[NodeHealth, ...]] = {}  #: nodes of each pad by pad name; empty for a log; read only
    outages: Outages[Failure] = Outages()
    load: float = 0.0  #: share of time for which the bus was busy in the last second, assuming worst-case bit stuffing
    is_error_passive: bool = False
    error_counters: ErrorCounters = ErrorCounters()
    foreign_commands: int = 0  #: NMT commands that another master sent to our nodes
    last_command: ForeignCommand | None = None  #: last NMT command from another master
    sync: SyncState = SyncState()
    #: overload of this process; during an overload, frames that seem to be missing may only be waiting to be processed
    overload: Overload = Overload.NOT_KNOWN
    stalls: int = 0  #: number of times this process did not run for a while

    @property
    def fault(self) -> BusFault:
        """Fault of the bus; NONE if the bus has not failed."""
        return BusFault.NONE if self.failure is None else self.failure.fault
