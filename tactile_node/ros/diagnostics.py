"""State and counts of the driver as a DiagnosticArray (REP-107). The level is never OK while data is being lost."""

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import repeat
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from tactile_node.assembly.facts import BUS_LOSSES, BusFacts, NodeFacts, PadFacts, counts_of, pad_counts
from tactile_node.assembly.facts_history import FactsHistory
from tactile_node.assembly.fault_text import sync_text
from tactile_node.assembly.health import SyncState
from tactile_node.conditioning.conditioned_pad import PadCondition
from tactile_node.conditioning.tared_pad import ZeroState
from tactile_node.conditioning.taxel_faults import FaultyTaxels, TaxelFault
from tactile_node.ros.message_health import status_of

MOST_NAMED = 20  #: Largest number of taxels of each kind that the text lists.
EVALUATED_PERIOD = 1.0  #: time over which the level is evaluated [s]
#: levels, the least severe first
SEVERITY = (DiagnosticStatus.OK, DiagnosticStatus.STALE, DiagnosticStatus.WARN, DiagnosticStatus.ERROR)


class Finding(NamedTuple):
    level: bytes
    message: str


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
        self._steady = steady
        self._history = FactsHistory(window)
        self._history.before(BusFacts(), -math.inf)  # before the first facts, all counts are 0

    def evaluate(self, facts: BusFacts, conditions: Mapping[str, PadCondition]) -> tuple[Finding, ...]:
        """Return the worst finding about the bus, then the worst finding about each pad.

        Facts without a pad come from a driver that has no bus, because it has failed or is not configured.
        """
        if not facts.pads:
            return (_failed(facts) or Finding(DiagnosticStatus.STALE, 'not configured'),)
        before, _ = self._history.before(facts, self._steady())
        findings = [_worst(_bus_findings(facts, before))]
        pads_before = {pad.pad: pad for pad in before.pads}
        for pad in facts.pads:
            pad_before = pads_before.get(pad.pad, PadFacts())
            of_pad = []
            for node, node_before in zip(pad.nodes, pad_before.nodes or repeat(NodeFacts())):
                of_pad += _node_findings(node, node_before, facts.active)
            of_pad += _pad_findings(pad, pad_before)
            if (condition := conditions.get(pad.pad)) is not None:
                of_pad += _condition_findings(condition)
            findings.append(_worst(of_pad))
        return tuple(findings)

    def message_of(self, findings: Sequence[Finding], facts: BusFacts,
                   conditions: Mapping[str, PadCondition]) -> DiagnosticArray:
        """Return the message for the findings that `evaluate` returned."""
        if not facts.pads:
            return DiagnosticArray(
                status=[status_of(f'{self._node}: bus', *findings[0], {'fault': facts.fault.name})])
        statuses = [self._status('bus', findings[0], _bus_values(facts))]
        for finding, pad in zip(findings[1:], facts.pads):
            extra: dict[str, object] = {}
            if (condition := conditions.get(pad.pad)) is not None:
                extra = {'faulty_taxels': faults_text(condition.faults), 'unchanged_s': f'{condition.unchanged:.2f}',
                         'other_publishers': ', '.join(condition.other_publishers), 'mirrored': condition.is_mirrored}
            statuses.append(self._status(pad.pad, finding, pad_counts(pad) | extra | _nodes_values(pad.nodes)))
        return DiagnosticArray(status=statuses)

    def _status(self, part: str, finding: Finding, values: dict[str, object]) -> DiagnosticStatus:
        return status_of(f'{self._node}: {part}', *finding, values, self._hardware_id)


def worst_level(findings: Iterable[Finding]) -> bytes:
    return max((finding.level for finding in findings), key=SEVERITY.index)


def faults_text(faults: FaultyTaxels) -> str:
    """Return the faulty taxels by kind, such as 'dead: (3, 4), (5, 0); stuck: (1, 2)'.

    The text names at most MOST_NAMED taxels of each kind.
    """
    found = {kind: faults.places(kind) for kind in TaxelFault if kind}
    return '; '.join(f'{kind.name.lower()}: {", ".join(map(str, places[:MOST_NAMED]))}'
                     + (f' and {len(places) - MOST_NAMED} more' if len(places) > MOST_NAMED else '')
                     for kind, places in found.items() if places)


def _failed(facts: BusFacts) -> Finding | None:
    return None if facts.failure is None else Finding(DiagnosticStatus.ERROR, str(facts.failure))


def _worst(findings: list[Finding]) -> Finding:
    """Combine all findings of the worst level into one finding."""
    level = worst_level(findings)
    return Finding(level, '; '.join(finding.message for finding in findings if finding.level == level))


def _bus_findings(now: BusFacts, before: BusFacts) -> list[Finding]:
    if failed := _failed(now):
        return [failed]
    grown = [name for name in BUS_LOSSES if getattr(now, name) > getattr(before, name)]
    texts = [f'growing: {", ".join(grown)}'] if grown else []
    texts += _new_outages(now, before)
    if now.error_passive:
        texts.append('the CAN controller is error-passive: check bit rate, wiring, termination')
    if now.foreign_nmt_commands > before.foreign_nmt_commands:
        texts.append(f'another NMT master has sent: {now.foreign_nmt_last}')
    if now.sync_fault.is_fault:
        texts.append(sync_text(SyncState(now.sync_fault, now.foreign_syncs, now.sync_period)))
    if now.overload.is_fault:
        texts.append(f'this process is overloaded: {now.overload}')
    return [Finding(DiagnosticStatus.WARN, one) for one in texts] or [Finding(DiagnosticStatus.OK, 'nothing lost')]


def _node_findings(now: NodeFacts, before: NodeFacts, is_active: bool) -> list[Finding]:
    findings = [Finding(DiagnosticStatus.ERROR, now.fault_text)] if now.fault.is_fault else []
    if not now.operational and not now.fault.is_fault:
        level = DiagnosticStatus.ERROR if is_active else DiagnosticStatus.STALE
        findings.append(Finding(level, f'node {now.node_id} is not OPERATIONAL: {now.nmt_state_text}'))
    texts = _new_outages(now, before)
    if now.emcy_active is not None:
        texts.append(f'node {now.node_id}: {now.emcy_active}')
    elif now.emcy_count > before.emcy_count:
        texts.append(f'node {now.node_id}: {now.emcy_last}')
    if now.frames_distrusted > before.frames_distrusted:
        texts.append(f'{now.frames_distrusted - before.frames_distrusted} taxel frames without values, because the '
                     'node was not configured, or because two devices sent its TPDOs')
    return findings + [Finding(DiagnosticStatus.WARN, one) for one in texts]


def _new_outages(now: BusFacts | NodeFacts, before: BusFacts | NodeFacts) -> list[str]:
    if now.outage_seconds == before.outage_seconds and now.outages == before.outages:
        return []
    return [f'no taxels for {now.outage_seconds - before.outage_seconds:.2f} s: {now.outage_last_reason}']


def _pad_findings(now: PadFacts, before: PadFacts) -> list[Finding]:
    lost = {reason: count - before.losses.get(reason, 0) for reason, count in now.losses.items()
            if count > before.losses.get(reason, 0)}
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


def _bus_values(facts: BusFacts) -> dict[str, object]:
    return {'fault': facts.fault.name,
            **{f'can_frames_{name}': count for name, count in facts.can_frames.items()},
            **counts_of(facts), 'stamps_ahead_s': f'{facts.stamps_ahead:.3f}',
            'bus_load_percent': f'{100 * facts.bus_load:.1f}',
            'tx_error_count': facts.tx_error_count,
            'rx_error_count': facts.rx_error_count,
            'error_passive': facts.error_passive, 'outage_seconds': f'{facts.outage_seconds:.2f}',
            'outage_last_reason': facts.outage_last_reason or '',
            'foreign_nmt_last': facts.foreign_nmt_last or '', 'sync_fault': facts.sync_fault.name,
            'sync_period_s': '' if math.isnan(facts.sync_period) else f'{facts.sync_period:.4f}',
            'overload': facts.overload.name}


def _nodes_values(nodes: tuple[NodeFacts, ...]) -> dict[str, object]:
    """Return the values of all nodes. If there are several nodes, the keys begin with ``node_<node-ID>_``."""
    if len(nodes) == 1:
        return _node_values(nodes[0])
    return {f'node_{node.node_id}_{key.removeprefix("node_")}': value
            for node in nodes for key, value in _node_values(node).items()}


def _node_values(node: NodeFacts) -> dict[str, object]:
    age = 'never heard' if math.isnan(node.heartbeat_age) else f'{node.heartbeat_age:.2f}'
    return {'node_id': node.node_id, 'serial_number': '' if node.serial_number is None else node.serial_number,
            'fault': node.fault.name, 'nmt_state': node.nmt_state_text,
            'heartbeat_age_s': age, **counts_of(node), 'emcy_last': node.emcy_last or '',
            'emcy_active': node.emcy_active or '',
            'outage_seconds': f'{node.outage_seconds:.2f}', 'outage_last_reason': node.outage_last_reason or ''}
