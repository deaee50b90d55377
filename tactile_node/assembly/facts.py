"""Facts about a bus, its pads and their CANopen nodes at one moment.

These classes are the only form in which the driver knows its state. Each part of the driver fills in the fields that it
counts or observes: the assembler, the router, the bus and the supervisor, in this order. The status message,
/diagnostics, the view, the report, the summaries and the log are made from these facts.

Fields and properties have the names of the fields of SkinStatus, PadStatus and NodeStatus. Code that reads only these
names, such as the view, therefore reads a message in the same way as facts. Where a message has a text, the facts may
have an object with that text, or None instead of ''.

A counter starts at 0 when the driver is configured, and never decreases.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import isnan, nan
from typing import Any

from tactile_node.assembly.fault_text import node_label, order_text, tpdos_text
from tactile_node.assembly.health import (
    BusFault,
    Failure,
    ForeignCommand,
    NodeFault,
    Overload,
    SentTpdo,
    SyncFault,
    TpdoOrder,
)
from tactile_node.cia301.emergency import DeviceErrors, Emergency
from tactile_node.cia301.objects import state_name
from tactile_node.code_names import PhrasedCode


def counter(meaning: str, is_loss: bool = False) -> Any:
    """Return the dataclass field of a counter.

    Parameters
    ----------
    meaning : str
        Explanation for the user.
    is_loss : bool
        True if the bus is at WARN while the counter grows. The view shows such a counter if it is not 0.
    """
    return field(default=0, metadata={'meaning': meaning, 'is_loss': is_loss})


@dataclass(frozen=True, slots=True)
class NodeFacts:
    """Facts about one CANopen node of a pad."""

    pad: str = ''  #: name of the pad
    node_id: int = 0
    state: int | None = None  #: NMT state last received; None if none was received
    operational: bool = False  #: True if a heartbeat within the timeout reports OPERATIONAL
    heartbeat_age: float = nan  #: time since the last heartbeat [s]; NaN if no heartbeat was received
    fault: NodeFault = NodeFault.NONE
    boots: int = counter('boot-up messages received')
    emcy_count: int = counter('error messages (EMCY) of the device')
    outages: int = counter('periods without taxels from this node')
    frames_distrusted: int = counter(
        'taxel frames published without values of this node, because the node was not configured (restart or refusal), '
        'or because two devices sent its TPDOs')
    outage_seconds: float = 0.0  #: total duration of the outages [s]
    outage_last_reason: Failure | NodeFault | None = None  #: initial cause of the last outage
    outage_present_reason: Failure | NodeFault | None = None  #: present cause of an ongoing outage
    emcy_last: Emergency | None = None
    emcy_active: Emergency | None = None  #: last error that the device has not cleared yet
    missing_tpdos: tuple[SentTpdo, ...] = ()  #: TPDOs that deliver no taxels while other TPDOs of the node do
    surplus_tpdos: tuple[SentTpdo, ...] = ()  #: TPDOs that are received more often than SYNC
    tpdo_order: TpdoOrder | None = None  #: sending order of the TPDOs if it differs from the layout, else None
    serial_number: int | None = None  #: object 0x1018, sub-index 4; None if unknown
    device_errors: DeviceErrors | None = None  #: errors that the device reported when it failed to become OPERATIONAL

    @property
    def nmt_state_text(self) -> str:
        return state_name(self.state)

    @property
    def fault_text(self) -> str:
        """Sentence about the fault, or '' if the node has no fault.

        >>> NodeFacts('left', 32, 0x05, False, 0.62, NodeFault.SILENT).fault_text
        "Node 32 (pad 'left'): it sends neither heartbeat nor taxels (last heartbeat 0.6 s ago: OPERATIONAL)."
        """
        if not self.fault.is_fault:
            return ''
        if self.fault is NodeFault.AWAITING_TAXELS:
            cause = self.outage_present_reason
            reason = f'; the outage: {cause}' if cause is not None else ''
        elif isnan(self.heartbeat_age):
            reason = ' (no heartbeat so far)'
        else:
            reason = f' (last heartbeat {self.heartbeat_age:.1f} s ago: {self.nmt_state_text})'
        return f'{node_label(self.pad, self.node_id)}: {self.fault}{self._details}{reason}.'

    @property
    def emcy_text(self) -> str:
        """Sentence about the last EMCY message."""
        return f'{node_label(self.pad, self.node_id)} sends {self.emcy_last}; {self.emcy_count} EMCY in all.'

    @property
    def _details(self) -> str:
        """Further facts about the fault, beginning with ': ', or '' if there are none."""
        if self.fault in (NodeFault.TPDO_MISSING, NodeFault.NO_TAXELS):
            facts = [tpdos_text(self.missing_tpdos)] if self.missing_tpdos else []
            facts += [order_text(self.tpdo_order)] if self.tpdo_order is not None else []
            return f': {"; ".join(facts)}' if facts else ''
        if self.fault is NodeFault.TWO_SENDERS and self.surplus_tpdos:
            return f': received more than once per SYNC: {tpdos_text(self.surplus_tpdos)}'
        if self.fault is NodeFault.NOT_OPERATIONAL and self.device_errors is not None:
            return f': {self.device_errors}'
        return ''


class LossReason(PhrasedCode):
    """Reason why a CAN frame of a pad does not contribute to any taxel frame."""

    BEFORE_FIRST_SYNC = 1, 'received before the first SYNC'
    OUT_OF_ORDER = 2, 'received after a TPDO that follows it in a sweep'
    LATE = 3, 'from an earlier period, or not proved to be from this one, or after a delayed SYNC'
    DUPLICATE = 4, 'the same COB-ID and bytes twice in a row'
    SURPLUS = 5, "after the period's frame was complete"
    SHORT = 6, 'fewer bytes than mapped'
    UNKNOWN_ROW = 7, 'a row number, or an MPDO, that is not in the layout'
    OVER_LONG = 8, 'more bytes than a CAN frame can have, or than the layout gives the DOMAIN'
    BROKEN = 9, 'an SDO upload that was aborted, lacks frames or has a wrong CRC'
    INCOMPLETE = 10, 'valid, but part of an incomplete taxel frame, which is withheld (drop_incomplete)'
    UNFINISHED = 11, 'the driver stopped within the period'


@dataclass(frozen=True, slots=True)
class PadFacts:
    """Facts about one pad.

    The number of received TPDOs equals used + pending + the sum of all losses.

    For a pad with a polled DOMAIN, read "SDO upload" wherever this text says "TPDO".
    """

    pad: str = ''  #: name of the pad
    frames_complete: int = counter('complete sweeps published')
    frames_incomplete: int = counter('incomplete sweeps published, with NaN for the missing taxels')
    frames_withheld: int = counter('incomplete sweeps not published (drop_incomplete)')
    #: TPDOs that all taxel frames, emitted or withheld, would hold if every frame were complete
    tpdos_expected: int = counter('TPDOs expected; a TPDO that is not received was lost on the bus or not sent')
    tpdos_received: int = counter('TPDOs received, valid or not')
    #: TPDOs longer than their mapping, but at most 8 bytes long
    tpdos_padded: int = counter('TPDOs longer than the layout maps, up to 8 bytes; their first bytes are used')
    tpdos_used: int = counter(
        'TPDOs used for published taxel frames, even if a frame then lacks their values (frames_distrusted)')
    tpdos_pending: int = 0  #: TPDOs that may still be used or lost
    losses: Mapping[LossReason, int] = field(default_factory=dict)  #: number of TPDOs lost for each reason
    nodes: tuple[NodeFacts, ...] = ()  #: CANopen nodes of the pad; empty for a log
    syncs: int = 0  #: SYNCs that began a period
    used_by_node: tuple[int, ...] = ()  #: ``tpdos_used`` for each node of the pad
    #: number of TPDOs received, without DUPLICATEs, by node and by TPDO in the order of the layout
    distinct_by_tpdo: tuple[tuple[int, ...], ...] = ()
    #: number of TPDOs used for a taxel frame, emitted or withheld, by node and by TPDO in the order of the layout
    fresh_by_tpdo: tuple[tuple[int, ...], ...] = ()
    #: order of each node's TPDOs if it differs from the layout, else None
    orders: tuple[TpdoOrder | None, ...] = ()

    @property
    def published(self) -> int:
        """Number of taxel frames emitted, complete or not."""
        return self.frames_complete + self.frames_incomplete

    @property
    def missing(self) -> int:
        """Number of expected TPDOs that were used for no published taxel frame."""
        return self.tpdos_expected - self.tpdos_used

    @property
    def loss_reasons(self) -> list[str]:
        return [reason.key for reason in self.losses]

    @property
    def loss_codes(self) -> list[int]:
        return [reason.value for reason in self.losses]

    @property
    def loss_counts(self) -> list[int]:
        return list(self.losses.values())


@dataclass(frozen=True, slots=True)
class BusFacts:
    """Facts about a bus or a log, and its pads."""

    pads: tuple[PadFacts, ...] = ()
    failure: Failure | None = None  #: reason why nothing can be received; None if the bus works
    active: bool = True  #: True if SYNC is on and the nodes are expected to be OPERATIONAL
    #: CAN frames received, by service; 'tpdo' counts the TPDOs of the pads, and 'foreign' counts the frames that belong
    #: to no pad
    can_frames: Mapping[str, int] = field(default_factory=dict)
    queue_overruns: int = counter('CAN frames lost because this process was too slow', is_loss=True)
    sync_overruns: int = counter('SYNCs not sent because this process was too slow', is_loss=True)
    sync_pauses: int = counter(
        'SYNCs skipped on purpose, so that the idle bus shows which SYNC a node is answering', is_loss=True)
    poll_overruns: int = counter(
        'polls of a DOMAIN skipped because the previous poll took longer than sync_period', is_loss=True)
    consumer_errors: int = counter('taxel frames that could not be published; the log gives the reason', is_loss=True)
    unread_log_lines: int = counter('damaged lines of a replayed log, which were skipped', is_loss=True)
    unrecorded_can_frames: int = counter(
        'CAN frames missing from the recording, because writing failed or the format cannot hold them', is_loss=True)
    error_frames: int = counter(
        'error frames reported by the CAN controller; with slcan, damaged lines of the serial port', is_loss=True)
    clock_jumps: int = counter('times the wall clock was set; the stamps never go back', is_loss=True)
    outages: int = counter('periods in which the bus did not work')
    foreign_nmt_commands: int = counter("NMT commands of another master to this driver's nodes")
    foreign_syncs: int = counter('SYNCs of other devices while this driver produces SYNC')
    stalls: int = counter("times this process did not run for half of a node's timeout")
    stamps_ahead: float = 0.0  #: time by which the stamps lead the wall clock after it was set back [s]
    #: share of time for which the bus was busy in the last second, assuming worst-case bit stuffing
    bus_load: float = 0.0
    error_passive: bool = False  #: True if the CAN controller is error-passive
    tx_error_count: int = 0  #: transmit error counter of the CAN controller
    rx_error_count: int = 0  #: receive error counter of the CAN controller
    outage_seconds: float = 0.0  #: total duration of the outages of the bus [s]
    outage_last_reason: Failure | None = None  #: initial cause of the last outage of the bus
    foreign_nmt_last: ForeignCommand | None = None  #: last NMT command from another master
    sync_fault: SyncFault = SyncFault.NOT_KNOWN
    sync_period: float = nan  #: period measured while another device produces SYNC [s], else NaN
    #: overload of this process; during an overload, frames that seem to be missing may only be waiting to be processed
    overload: Overload = Overload.NOT_KNOWN

    def pad(self, name: str) -> PadFacts:
        """Return the facts about the pad called ``name``."""
        return {pad.pad: pad for pad in self.pads}[name]

    @property
    def fault(self) -> BusFault:
        """Fault of the bus; NONE if the bus has not failed."""
        return BusFault.NONE if self.failure is None else self.failure.fault


#: Names of the counters of losses on the bus itself.
BUS_LOSSES = tuple(each.name for each in fields(BusFacts) if each.metadata.get('is_loss'))


def meanings(kind: type[BusFacts | PadFacts | NodeFacts]) -> dict[str, str]:
    """Return the meaning of each counter by name."""
    return {each.name: each.metadata['meaning'] for each in fields(kind) if 'meaning' in each.metadata}


def counts_of(facts: BusFacts | PadFacts | NodeFacts) -> dict[str, int]:
    """Return the counters by name."""
    return {name: getattr(facts, name) for name in meanings(type(facts))}


def pad_counts(pad: PadFacts) -> Counter[str]:
    """Return the counters and the losses of a pad by name. ``pad`` may also be a PadStatus, which lacks two counters.

    >>> pad_counts(PadFacts(tpdos_used=9, losses={LossReason.LATE: 2}))['tpdos_lost_late']
    2
    """
    counts = {name: int(getattr(pad, name, 0)) for name in meanings(PadFacts)}
    return Counter(counts | {f'{LOST}{reason}': int(count) for reason, count in zip(pad.loss_reasons, pad.loss_counts)})


LOST = 'tpdos_lost_'  #: beginning of the names of the losses among the counts of a pad


def losses_in(counts: Mapping[str, int]) -> dict[str, int]:
    """Return the losses among the counts of a pad by reason, without reasons whose count is 0."""
    return {name.removeprefix(LOST): count for name, count in counts.items() if name.startswith(LOST) and count}
