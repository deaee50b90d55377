"""State and counts of the driver as a SkinStatus message, with the same levels as on /diagnostics."""

import math
from array import array
from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import State

from tactile_node.assembly import counters
from tactile_node.assembly.fault_text import command_text, failure_text, node_text
from tactile_node.assembly.frame_source import BusStatistics, PadStatistics
from tactile_node.assembly.health import BusHealth, NodeHealth
from tactile_node.cia301.objects import NmtState, state_name
from tactile_node.conditioning.conditioned_pad import PadCondition
from tactile_node.conditioning.tare import ZeroState
from tactile_node.conditioning.taxel_faults import FaultyTaxels, TaxelFault
from tactile_skin.msg import FaultyTaxel, NodeStatus, PadStatus, SkinStatus

#: NMT state -> its number in NodeStatus.msg; None is the state of a node that was never heard from
NMT_NUMBERS: Mapping[int | None, int] = {None: NodeStatus.NMT_NOT_KNOWN, NmtState.BOOT_UP: NodeStatus.NMT_BOOT_UP,
               NmtState.STOPPED: NodeStatus.NMT_STOPPED, NmtState.OPERATIONAL: NodeStatus.NMT_OPERATIONAL,
               NmtState.PRE_OPERATIONAL: NodeStatus.NMT_PRE_OPERATIONAL}
SEVERITY = (DiagnosticStatus.OK, DiagnosticStatus.STALE, DiagnosticStatus.WARN, DiagnosticStatus.ERROR)


class PrimaryState(IntEnum):
    """Primary states of a lifecycle node, with the codes of lifecycle_msgs/State and of SkinStatus."""

    NOT_KNOWN = State.PRIMARY_STATE_UNKNOWN
    UNCONFIGURED = State.PRIMARY_STATE_UNCONFIGURED
    INACTIVE = State.PRIMARY_STATE_INACTIVE
    ACTIVE = State.PRIMARY_STATE_ACTIVE
    FINALIZED = State.PRIMARY_STATE_FINALIZED


def status_message(diagnostics: DiagnosticArray, counts: BusStatistics, health: BusHealth,
                   conditions: Mapping[str, PadCondition] = MappingProxyType({}),
                   lifecycle: PrimaryState = PrimaryState.NOT_KNOWN) -> SkinStatus:
    """Return the status of the driver as a message.

    Parameters
    ----------
    diagnostics
        Message of BusDiagnostics for the same counts and health, which lists the bus before its pads.
    counts
        Counts of the bus and its pads.
    health
        Health of the bus and its nodes.
    conditions
        Condition of the taxels, by pad name.
    lifecycle
        Lifecycle state of the driver.
    """
    bus, *pads = diagnostics.status
    worst = max((status.level for status in diagnostics.status), key=SEVERITY.index)
    return SkinStatus(
        header=diagnostics.header, level=_level(worst), message=bus.message, active=health.is_active,
        lifecycle_state=lifecycle,
        fault=health.fault.value, failure=failure_text(health.failure), bus_load=health.load,
        error_passive=health.is_error_passive, tx_error_count=health.error_counters.tx,
        rx_error_count=health.error_counters.rx, **counters.read_fields(counters.BUS_LOSSES, counts),
        **counters.read_fields(counters.BUS_EVENTS, health), foreign_nmt_last=command_text(health.last_command),
        sync_fault=health.sync.fault.value,
        sync_period=math.nan if health.sync.period is None else health.sync.period,
        overload=health.overload.value, outage_seconds=health.outages.seconds,
        outage_last_reason=failure_text(health.outages.cause),
        pads=[_pad(name, status, pad, nodes=health.nodes.get(name, ()), condition=conditions.get(name))
              for status, (name, pad) in zip(pads, counts.pads.items())])


def _level(level: bytes) -> int:
    """Return the level as a SkinStatus number; these begin at 1, because 0 is the default of a message field."""
    return level[0] + 1


def _pad(name: str, status: DiagnosticStatus, pad: PadStatistics, nodes: tuple[NodeHealth, ...],
         condition: PadCondition | None) -> PadStatus:
    return PadStatus(
        pad=name, level=_level(status.level), message=status.message, nodes=[_node(name, node) for node in nodes],
        **counters.read_fields(counters.PAD_COUNTERS, pad), loss_reasons=[reason.key for reason in pad.losses],
        loss_codes=array('B', [reason.value for reason in pad.losses]), loss_counts=array('Q', pad.losses.values()),
        faulty_taxels=_faulty(condition.faults) if condition else [],
        unchanged=condition.unchanged if condition else math.nan,
        zero_state=(condition.zero if condition else ZeroState.NOT_KNOWN).value)


def _faulty(faults: FaultyTaxels) -> list[FaultyTaxel]:
    return [FaultyTaxel(row=row, col=col, code=kind.value, fault=kind.name.lower())
            for kind in TaxelFault if kind for row, col in faults.places(kind)]


def _node(pad: str, node: NodeHealth) -> NodeStatus:
    return NodeStatus(
        node_id=node.node_id, nmt_state=NMT_NUMBERS.get(node.state, NodeStatus.NMT_UNDEFINED),
        nmt_state_text=state_name(node.state), operational=node.is_operational, fault=node.fault.value,
        fault_text=node_text(pad, node),
        heartbeat_age=math.nan if node.heartbeat_age is None else node.heartbeat_age,
        **counters.read_fields(counters.NODE_COUNTERS, node), emcy_last=str(node.last_emergency or ''),
        emcy_active=str(node.active_emergency or ''), outage_seconds=node.outages.seconds,
        outage_last_reason=failure_text(node.outages.cause))
