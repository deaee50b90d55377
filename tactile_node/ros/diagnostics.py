"""What the driver counts, as DiagnosticArray (REP-107): never OK while data is being discarded."""

from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from tactile_node.canbus.assembler import PadStatistics
from tactile_node.canbus.router import BusStatistics


class Finding(NamedTuple):
    level: bytes
    message: str


class BusDiagnostics:
    """Turns successive statistics of one bus into messages; the level speaks of the time between two of them."""

    def __init__(self, node: str, hardware_id: str):
        self._node, self._hardware_id, self._before = node, hardware_id, None

    def message(self, now: BusStatistics, failure: str | None) -> DiagnosticArray:
        """``failure``: why nothing can be received any more, None while it can."""
        before = self._before or _nothing_yet(now)
        self._before = now
        statuses = [self._status('bus', _bus_finding(now, before, failure), _bus_values(now))]
        statuses += [self._status(name, _pad_finding(pad, before.pads[name]), _pad_values(pad))
                     for name, pad in now.pads.items()]
        return DiagnosticArray(status=statuses)

    def _status(self, part: str, finding: Finding, values: dict[str, int]) -> DiagnosticStatus:
        return DiagnosticStatus(
            level=finding.level, name=f'{self._node}: {part}', message=finding.message, hardware_id=self._hardware_id,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])


def _nothing_yet(now: BusStatistics) -> BusStatistics:
    """The same counts at zero: what was lost before the first message is lost all the same."""
    pads = {name: PadStatistics(0, 0, 0, 0, 0, 0, dict.fromkeys(pad.losses, 0)) for name, pad in now.pads.items()}
    return BusStatistics(pads, {})


def _bus_finding(now: BusStatistics, before: BusStatistics, failure: str | None) -> Finding:
    if failure is not None:
        return Finding(DiagnosticStatus.ERROR, failure)
    grown = [name for name, count in _bus_losses(now).items() if count > _bus_losses(before)[name]]
    if grown:
        return Finding(DiagnosticStatus.WARN, f'growing: {", ".join(grown)}')
    return Finding(DiagnosticStatus.OK, 'nothing lost')


def _pad_finding(now: PadStatistics, before: PadStatistics) -> Finding:
    lost = {reason: count - before.losses[reason] for reason, count in now.losses.items()
            if count > before.losses[reason]}
    missing = now.missing - before.missing
    if missing > 0 or lost:
        told = [f'{missing} TPDOs missing'] if missing > 0 else []
        told += [f'{count} TPDOs dropped ({reason})' for reason, count in lost.items()]
        return Finding(DiagnosticStatus.WARN, ', '.join(told))
    if now.published == before.published:
        return Finding(DiagnosticStatus.STALE, 'no taxel frames')
    return Finding(DiagnosticStatus.OK, f'{now.published - before.published} taxel frames, none incomplete')


def _bus_losses(statistics: BusStatistics) -> dict[str, int]:
    return {'queue_overruns': statistics.queue_overruns, 'sync_overruns': statistics.sync_overruns,
            'consumer_errors': statistics.consumer_errors, 'unread_log_lines': statistics.unread}


def _bus_values(statistics: BusStatistics) -> dict[str, int]:
    return {**{f'can_frames_{name}': count for name, count in statistics.can_frames.items()},
            **_bus_losses(statistics)}


def _pad_values(pad: PadStatistics) -> dict[str, int]:
    return {'frames_complete': pad.complete, 'frames_incomplete': pad.incomplete,
            'tpdos_expected': pad.expected, 'tpdos_received': pad.received, 'tpdos_used': pad.used,
            **{f'tpdos_dropped_{reason}': count for reason, count in pad.losses.items()}}
