"""Tables of the driver's counters.

The status message, /diagnostics, the view and the reference pages are generated from these tables.

A counter starts at 0 when the driver is configured, and never decreases. Lost TPDOs are counted by `LossReason`.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

from tactile_node.assembly.frame_source import BusStatistics, PadStatistics
from tactile_node.assembly.health import BusHealth, NodeHealth

Source = TypeVar('Source', BusStatistics, BusHealth, PadStatistics, NodeHealth)


@dataclass(frozen=True)
class Counter(Generic[Source]):
    """A counter and the function that reads it."""

    name: str     #: key on /diagnostics and field of the status message
    meaning: str  #: explanation for the user
    count: Callable[[Source], int]  #: function that reads the counter from its source
    is_field: bool = True  #: True if the status message has this field


#: Counters of losses on a bus. The bus is at WARN while one of these counters grows. The view shows the counters that
#: are not 0.
BUS_LOSSES: tuple[Counter[BusStatistics], ...] = (
    Counter('queue_overruns', 'CAN frames lost because this process was too slow', lambda bus: bus.queue_overruns),
    Counter('sync_overruns', 'SYNCs not sent because this process was too slow', lambda bus: bus.sync_overruns),
    Counter('sync_pauses', 'SYNCs skipped on purpose, so that the idle bus shows which SYNC a node is answering',
            lambda bus: bus.sync_pauses),
    Counter('poll_overruns', 'polls of a DOMAIN skipped because the previous poll took longer than sync_period',
            lambda bus: bus.poll_overruns),
    Counter('consumer_errors', 'taxel frames that could not be published; the log gives the reason',
            lambda bus: bus.consumer_errors),
    Counter('unread_log_lines', 'damaged lines of a replayed log, which were skipped', lambda bus: bus.unread),
    Counter('unrecorded_can_frames',
            'CAN frames missing from the recording, because writing failed or the format cannot hold them',
            lambda bus: bus.unrecorded),
    Counter('error_frames', 'error frames reported by the CAN controller',
            lambda bus: bus.can_frames.get('error', 0)),
    Counter('clock_jumps', 'times the wall clock was set; the stamps never go back', lambda bus: bus.clock_jumps))

BUS_EVENTS: tuple[Counter[BusHealth], ...] = (
    Counter('outages', 'periods in which the bus did not work', lambda health: health.outages.count),
    Counter('foreign_nmt_commands', "NMT commands of another master to this driver's nodes",
            lambda health: health.foreign_commands),
    Counter('foreign_syncs', 'SYNCs of other devices while this driver produces SYNC',
            lambda health: health.sync.foreign),
    Counter('stalls', "times this process did not run for half of a node's timeout", lambda health: health.stalls))

PAD_COUNTERS: tuple[Counter[PadStatistics], ...] = (
    Counter('frames_complete', 'complete sweeps published', lambda pad: pad.complete),
    Counter('frames_incomplete', 'incomplete sweeps published, with NaN for the missing taxels',
            lambda pad: pad.incomplete),
    Counter('frames_withheld', 'incomplete sweeps not published (drop_incomplete)',
            lambda pad: pad.withheld, is_field=False),
    Counter('tpdos_expected', 'TPDOs expected; a TPDO that is not received was lost on the bus or not sent',
            lambda pad: pad.expected),
    Counter('tpdos_received', 'TPDOs received, valid or not', lambda pad: pad.received),
    Counter('tpdos_padded', 'TPDOs longer than the layout maps, up to 8 bytes; their first bytes are used',
            lambda pad: pad.padded, is_field=False),
    Counter('tpdos_used', 'TPDOs whose taxels were published as valid', lambda pad: pad.used))

NODE_COUNTERS: tuple[Counter[NodeHealth], ...] = (
    Counter('boots', 'boot-up messages received', lambda node: node.boots),
    Counter('emcy_count', 'error messages (EMCY) of the device', lambda node: node.emergencies),
    Counter('outages', 'periods without taxels from this node', lambda node: node.outages.count),
    Counter('frames_distrusted',
            'taxel frames published without values of this node, because it was not configured (restart or refusal)',
            lambda node: node.distrusted))


def read_counters(counters: Iterable[Counter[Source]], source: Source) -> dict[str, int]:
    """Return the counts of ``source`` by counter name."""
    return {counter.name: counter.count(source) for counter in counters}


def read_fields(counters: Iterable[Counter[Source]], source: Source) -> dict[str, int]:
    """Return, by field name, the counts of ``source`` that have a field in the status message."""
    return read_counters((counter for counter in counters if counter.is_field), source)
