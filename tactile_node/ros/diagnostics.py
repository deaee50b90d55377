"""State and counts of the driver as a DiagnosticArray (REP-107). The level is never OK while data is being lost."""

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from tactile_node.assembly import counters
from tactile_node.assembly.fault_text import command_text, failure_text, node_text, sync_text
from tactile_node.assembly.frame_source import BusStatistics, PadStatistics
from tactile_node.assembly.health import BusHealth, NodeHealth, Outages
from tactile_node.cia301.objects import state_name
from tactile_node.conditioning.conditioned_pad import PadCondition, faults_text
from tactile_node.conditioning.tare import ZeroState
from tactile_node.ros.message_health import status_of

EVALUATED_PERIOD = 1.0  #: time over which the level is evaluated [s]


class Finding(NamedTuple):
    level: bytes
    message: str


class Snapshot(NamedTuple):
    """Counts and health at one time on the monotonic clock."""

    at: float  #: [s]
    counts: BusStatistics
    health: BusHealth


class BusDiagnostics:
    """Converts successive states of one bus to diagnostic messages.

    The level covers the time since the latest state that is at least ``window`` old. A loss is therefore reported for
    at least ``window``, no matter how often the state is evaluated.

    Parameters
    ----------
    node
        Full name of the node.
    hardware_id
        Hardware identifier to put into the messages.
    window
        Shortest time that the level covers [s].
    steady
        Steady clock [s].
    """

    def __init__(self, node: str, hardware_id: str, window: float = EVALUATED_PERIOD,
                 steady: Callable[[], float] = time.monotonic):
        self._node = node
        self._hardware_id = hardware_id
        self._window = window
        self._steady = steady
        self._snapshots: deque[Snapshot] = deque()  # states in ascending order of time; the first one is the reference

    def evaluate(self, counts: BusStatistics, health: BusHealth,
                 conditions: Mapping[str, PadCondition]) -> tuple[Finding, ...]:
        """Return the worst finding about the bus, then the worst finding about each pad."""
        before = self._before(Snapshot(self._steady(), counts, health))
        findings = [_worst(_bus_findings(counts, before.counts, health, before.health))]
        for name, pad in counts.pads.items():
            nodes = health.nodes.get(name, ())  # a replayed log reports no CANopen nodes
            of_pad = []
            for node, node_before in zip(nodes, before.health.nodes.get(name) or map(_new, nodes)):
                of_pad += _node_findings(name, node, node_before, health.is_active)
            of_pad += _pad_findings(pad, before.counts.pads[name])
            if (condition := conditions.get(name)) is not None:
                of_pad += _condition_findings(condition)
            findings.append(_worst(of_pad))
        return tuple(findings)

    def message_of(self, findings: Sequence[Finding], counts: BusStatistics, health: BusHealth,
                   conditions: Mapping[str, PadCondition]) -> DiagnosticArray:
        """Return the message for the findings that `evaluate` returned."""
        statuses = [self._status('bus', findings[0], _bus_values(counts, health))]
        for finding, (name, pad) in zip(findings[1:], counts.pads.items()):
            extra: dict[str, object] = {}
            if (condition := conditions.get(name)) is not None:
                extra = {'faulty_taxels': faults_text(condition.faults), 'unchanged_s': f'{condition.unchanged:.2f}',
                         'other_publishers': ', '.join(condition.other_publishers)}
            statuses.append(self._status(name, finding,
                                         _pad_values(pad) | extra | _nodes_values(health.nodes.get(name, ()))))
        return DiagnosticArray(status=statuses)

    def _before(self, now: Snapshot) -> Snapshot:
        """Return the latest state that is at least ``window`` old. Before the first state, all counts are zero."""
        snapshots = self._snapshots
        if not snapshots:
            snapshots.append(Snapshot(-math.inf, _nothing_yet(now.counts), BusHealth()))
        while len(snapshots) > 1 and now.at - snapshots[1].at >= self._window:
            snapshots.popleft()
        before = snapshots[0]
        snapshots.append(now)
        return before

    def _status(self, part: str, finding: Finding, values: dict[str, object]) -> DiagnosticStatus:
        return status_of(f'{self._node}: {part}', *finding, values, self._hardware_id)


def unconfigured(health: BusHealth) -> tuple[Finding, ...]:
    """Return the finding about a driver that has no bus, because it has failed or is not configured."""
    if health.failure is not None:
        return (Finding(DiagnosticStatus.ERROR, failure_text(health.failure)),)
    return (Finding(DiagnosticStatus.STALE, 'not configured'),)


def diagnostic_array(node: str, finding: Finding, health: BusHealth) -> DiagnosticArray:
    """Return the message about a driver without a bus."""
    return DiagnosticArray(status=[status_of(f'{node}: bus', *finding, {'fault': health.fault.name})])


def _nothing_yet(now: BusStatistics) -> BusStatistics:
    """Return counts that are all zero, so that losses before the first message also count."""
    pads = {name: PadStatistics(complete=0, incomplete=0, expected=0, received=0, used=0, pending=0,
                                losses=dict.fromkeys(pad.losses, 0)) for name, pad in now.pads.items()}
    return BusStatistics(pads, {})


def _new(node: NodeHealth) -> NodeHealth:
    return NodeHealth(node.node_id, None, True, None)


def _worst(findings: list[Finding]) -> Finding:
    """Combine all findings of the worst level into one finding."""
    order = (DiagnosticStatus.ERROR, DiagnosticStatus.WARN, DiagnosticStatus.STALE, DiagnosticStatus.OK)
    level = next(level for level in order if any(finding.level == level for finding in findings))
    return Finding(level, '; '.join(finding.message for finding in findings if finding.level == level))


def _bus_findings(now: BusStatistics, before: BusStatistics, health: BusHealth,
                  health_before: BusHealth) -> list[Finding]:
    if health.failure is not None:
        return [Finding(DiagnosticStatus.ERROR, failure_text(health.failure))]
    grown = [loss.name for loss in counters.BUS_LOSSES if loss.count(now) > loss.count(before)]
    texts = [f'growing: {", ".join(grown)}'] if grown else []
    texts += _new_outages(health.outages, health_before.outages)
    if health.is_error_passive:
        texts.append('the CAN controller is error-passive: check bit rate, wiring, termination')
    if health.foreign_commands > health_before.foreign_commands:
        texts.append(f'another NMT master has sent: {command_text(health.last_command)}')
    if health.sync.fault.is_fault:
        texts.append(sync_text(health.sync))
    if health.overload.is_fault:
        texts.append(f'this process is overloaded: {health.overload.phrase}')
    return [Finding(DiagnosticStatus.WARN, one) for one in texts] or [Finding(DiagnosticStatus.OK, 'nothing lost')]


def _node_findings(pad: str, now: NodeHealth, before: NodeHealth, is_active: bool) -> list[Finding]:
    findings = [Finding(DiagnosticStatus.ERROR, node_text(pad, now))] if now.fault.is_fault else []
    if not now.is_operational and not now.fault.is_fault:
        level = DiagnosticStatus.ERROR if is_active else DiagnosticStatus.STALE
        findings.append(Finding(level, f'node {now.node_id} is not OPERATIONAL: {state_name(now.state)}'))
    texts = _new_outages(now.outages, before.outages)
    if now.active_emergency is not None:
        texts.append(f'node {now.node_id}: {now.active_emergency}')
    elif now.emergencies > before.emergencies:
        texts.append(f'node {now.node_id}: {now.last_emergency}')
    if now.distrusted > before.distrusted:
        texts.append(f'{now.distrusted - before.distrusted} taxel frames without values, because the node was '
                     'not configured')
    return findings + [Finding(DiagnosticStatus.WARN, one) for one in texts]


def _new_outages(now: Outages, before: Outages) -> list[str]:
    if now.seconds == before.seconds and now.count == before.count:
        return []
    return [f'no taxels for {now.seconds - before.seconds:.2f} s: {failure_text(now.cause)}']


def _pad_findings(now: PadStatistics, before: PadStatistics) -> list[Finding]:
    lost = {reason: count - before.losses[reason] for reason, count in now.losses.items()
            if count > before.losses[reason]}
    missing = now.missing - before.missing
    if missing > 0 or lost:
        texts = [f'{missing} TPDOs missing'] if missing > 0 else []
        texts += [f'{count} TPDOs lost ({reason.key})' for reason, count in lost.items()]
        return [Finding(DiagnosticStatus.WARN, ', '.join(texts))]
    if now.published == before.published:
        return [Finding(DiagnosticStatus.STALE, 'no taxel frames')]
    return [Finding(DiagnosticStatus.OK, f'{now.published - before.published} taxel frames, none incomplete')]


def _condition_findings(condition: PadCondition) -> list[Finding]:
    faults = condition.faults
    texts = [f'{faults.total} faulty taxels, {faults_text(faults)}'] if faults.total else []
    if condition.is_frozen:
            texts.append(f'no taxel has changed by one count for {condition.unchanged:.1f} s: the device may have '
                         'stopped sampling')
    if condition.other_publishers:
            texts.append(f'other nodes also publish the taxels of this pad: {", ".join(condition.other_publishers)}')
    findings = [Finding(DiagnosticStatus.WARN, one) for one in texts]
    if condition.zero is not ZeroState.VALID:
        detail = f': {condition.zero_error}' if condition.zero_error else ''
        sentence = f'no value is valid until the next tare: {condition.zero.phrase}{detail}'
        findings.append(Finding(DiagnosticStatus.ERROR, sentence))
    return findings


def _bus_values(statistics: BusStatistics, health: BusHealth) -> dict[str, object]:
    return {'fault': health.fault.name,
            **{f'can_frames_{name}': count for name, count in statistics.can_frames.items()},
            **counters.read_counters(counters.BUS_LOSSES, statistics),
            **counters.read_counters(counters.BUS_EVENTS, health), 'stamps_ahead_s': f'{statistics.stamps_ahead:.3f}',
            'bus_load_percent': f'{100 * health.load:.1f}',
            'tx_error_count': health.error_counters.tx,
            'rx_error_count': health.error_counters.rx,
            'error_passive': health.is_error_passive, 'outage_seconds': f'{health.outages.seconds:.2f}',
            'outage_last_reason': failure_text(health.outages.cause),
            'foreign_nmt_last': command_text(health.last_command), 'sync_fault': health.sync.fault.name,
            'sync_period_s': '' if health.sync.period is None else f'{health.sync.period:.4f}',
            'overload': health.overload.name}


def _pad_values(pad: PadStatistics) -> dict[str, object]:
    return {**counters.read_counters(counters.PAD_COUNTERS, pad),
            **{f'tpdos_lost_{reason.key}': count for reason, count in pad.losses.items()}}


def _nodes_values(nodes: tuple[NodeHealth, ...]) -> dict[str, object]:
    """Return the values of all nodes. If there are several nodes, the keys begin with ``node_<node-ID>_``."""
    if len(nodes) == 1:
        return _node_values(nodes[0])
    return {f'node_{node.node_id}_{key.removeprefix("node_")}': value
            for node in nodes for key, value in _node_values(node).items()}


def _node_values(node: NodeHealth) -> dict[str, object]:
    age = 'never heard' if node.heartbeat_age is None else f'{node.heartbeat_age:.2f}'
    return {'node_id': node.node_id, 'fault': node.fault.name, 'nmt_state': state_name(node.state),
            'heartbeat_age_s': age, **counters.read_counters(counters.NODE_COUNTERS, node),
            'emcy_last': node.last_emergency or '', 'emcy_active': node.active_emergency or '',
            'outage_seconds': f'{node.outages.seconds:.2f}', 'outage_last_reason': failure_text(node.outages.cause)}
