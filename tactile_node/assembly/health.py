"""Faults of a bus and its nodes, with the facts that describe them.

The text of a fault is a clause without a full stop. The module ``fault_text`` makes sentences of such clauses.
"""

from dataclasses import dataclass, replace
from enum import unique
from math import nan
from typing import Generic, NamedTuple, TypeVar

from tactile_node.cia301.objects import command_name
from tactile_node.code_names import PhrasedCode


class Fault(PhrasedCode):
    """A fault. Code 0 means that the fault is not known, and code 1 means that there is no fault."""

    def __str__(self) -> str:
        return self.phrase

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
    period: float = nan  #: period measured while another device produces SYNC [s], else NaN


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
    """The fault of a bus or a log. Its text is a clause without a full stop.

    >>> print(Failure(BusFault.SENDING_FAILED, 'Transmit buffer full.'))
    the CAN bus cannot send: Transmit buffer full
    """

    fault: BusFault
    detail: str = ''  #: text from the adapter, the device or the operating system

    def __str__(self) -> str:
        return f'{self.fault}: {self.detail.removesuffix(".")}' if self.detail else str(self.fault)


#: Cause of an outage. A bus has an outage because of a failure. A node has an outage because of its own fault or a
#: failure of its bus.
Cause = TypeVar('Cause', bound=Failure | NodeFault)


@dataclass(frozen=True)
class Outages(Generic[Cause]):
    """Outages of a bus or a node since construction. Times are from the monotonic clock [s].

    An outage is a time without taxels. ``count`` includes an ongoing outage. ``seconds`` includes an ongoing outage up
    to ``begun``; `until` also includes the time since then.
    """

    count: int = 0
    seconds: float = 0.0  #: total duration [s]
    cause: Cause | None = None  #: initial cause of the last outage
    current: Cause | None = None  #: present cause of an ongoing outage; None if there is no outage
    begun: float | None = None  #: time from which an ongoing outage is not counted in ``seconds``; None without outage

    def begin(self, now: float, cause: Cause) -> 'Outages[Cause]':
        """Return the outages with a new one that begins now. If an outage is ongoing, only its present cause changes.

        >>> outages = Outages().begin(10.0, NodeFault.SILENT).begin(11.0, NodeFault.BOOTED)
        >>> outages.count, outages.cause is NodeFault.SILENT, outages.current is NodeFault.BOOTED
        (1, True, True)
        >>> outages.until(12.5).seconds, outages.end(13.0).until(99.0).seconds, outages.end(13.0).current
        (2.5, 3.0, None)
        """
        if self.begun is not None:
            return replace(self, current=cause)
        return replace(self, count=self.count + 1, cause=cause, current=cause, begun=now)

    def end(self, now: float) -> 'Outages[Cause]':
        """Return the outages after the end of the ongoing outage, if there is one."""
        return replace(self.until(now), current=None, begun=None)

    def until(self, now: float) -> 'Outages[Cause]':
        """Return the outages with the duration of the ongoing outage up to now."""
        if self.begun is None:
            return self
        return replace(self, seconds=self.seconds + now - self.begun, begun=now)


class ErrorCounters(NamedTuple):
    """Error counters of the CAN controller, taken from its last error frame (ISO 11898-1).

    The controller issues a warning at 96. Above 127, the controller is error-passive.
    """

    tx: int = 0  #: transmit error counter
    rx: int = 0  #: receive error counter


class ForeignCommand(NamedTuple):
    """An NMT command (CiA 301) from another master.

    >>> print(ForeignCommand(0x81, 32), ForeignCommand(0x02, 0), sep=', ')
    reset node to node 32, stop to all nodes
    """

    command: int  #: command specifier
    node_id: int  #: addressed node; 0 for all nodes

    def __str__(self) -> str:
        return f'{command_name(self.command)} to {f"node {self.node_id}" if self.node_id else "all nodes"}'
