"""The counters of a driver: its status, /diagnostics, the view and the reference are made from these tables.

A counter begins at 0 when the driver is configured, and only rises. TPDOs lost are counted by `LossReason`.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

from tactile_node.assembly.frame_source import BusStatistics, PadStatistics
from tactile_node.assembly.health import BusHealth, NodeHealth

Source = TypeVar('Source', BusStatistics, BusHealth, PadStatistics, NodeHealth)


@dataclass(frozen=True)
class Counter(Generic[Source]):
    """What is counted, and where it is read."""

    name: str     #: its key on /diagnostics, and its field in the status message
    meaning: str
    count: Callable[[Source], int]
    is_field: bool = True  #: the status message has it


#: Losses of a bus: WARN while one of them grows; the view shows those that are not 0.
BUS_LOSSES: tuple[Counter[BusStatistics], ...] = (
    Counter('queue_overruns', 'CAN frames lost because this process was too slow', lambda bus: bus.queue_overruns),
    Counter('sync_overruns', 'SYNCs not sent because this process was too slow', lambda bus: bus.sync_overruns),
    Counter('sync_pauses', 'SYNCs left out so that the bus is idle and shows how far a node is',
            lambda bus: bus.sync_pauses),
    Counter('poll_overruns', 'polls of a DOMAIN left out: the one before took longer than sync_period',
            lambda bus: bus.poll_overruns),
    Counter('consumer_errors', 'taxel frames whose publishing has failed; the log gives the reason',
            lambda bus: bus.consumer_errors),
    Counter('unread_log_lines', 'lines of a replayed log left out because it is damaged', lambda bus: bus.unread),
    Counter('unrecorded_can_frames', 'missing in the recording: it has failed, or its format has no place for them',
            lambda bus: bus.unrecorded),
    Counter('error_frames', 'errors on the wire that the CAN controller saw',
            lambda bus: bus.can_frames.get('error', 0)),
    Counter('clock_jumps', 'times the wall clock was set; stamps did not go back', lambda bus: bus.clock_jumps))

BUS_EVENTS: tuple[Counter[BusHealth], ...] = (
    Counter('outages', 'times the bus did not work', lambda health: health.outages.count),
    Counter('foreign_nmt_commands', 'commands of another NMT master to our nodes',
            lambda health: health.foreign_commands),
    Counter('foreign_syncs', 'SYNCs of other devices while this driver produces SYNC',
            lambda health: health.sync.foreign),
    Counter('stalls', "times this process did not run for half of a node's timeout", lambda health: health.stalls))

PAD_COUNTERS: tuple[Counter[PadStatistics], ...] = (
    Counter('frames_complete', 'sweeps published whole', lambda pad: pad.complete),
    Counter('frames_incomplete', 'sweeps published with NaN', lambda pad: pad.incomplete),
    Counter('frames_withheld', 'incomplete sweeps that are not published (drop_incomplete)',
            lambda pad: pad.withheld, is_field=False),
    Counter('tpdos_expected', 'more than received: the rest was lost on the bus or not sent',
            lambda pad: pad.expected),
    Counter('tpdos_received', 'good or not', lambda pad: pad.received),
    Counter('tpdos_padded', 'longer than the layout maps, up to 8 bytes: their first bytes are used',
            lambda pad: pad.padded, is_field=False),
    Counter('tpdos_used', 'whose taxels were published as valid', lambda pad: pad.used))

NODE_COUNTERS: tuple[Counter[NodeHealth], ...] = (
    Counter('boots', 'boot-up messages', lambda node: node.boots),
    Counter('emcy_count', "the device's own error messages", lambda node: node.emergencies),
    Counter('outages', 'times without taxels of this node', lambda node: node.outages.count),
    Counter('frames_distrusted',
            'taxel frames without values: the node has restarted and is not configured yet, or it refuses the set-up',
            lambda node: node.distrusted))


def read_counters(counters: Iterable[Counter[Source]], source: Source) -> dict[str, int]:
    """Return the counts of ``source`` by name."""
    return {counter.name: counter.count(source) for counter in counters}


def read_fields(counters: Iterable[Counter[Source]], source: Source) -> dict[str, int]:
    """Return the counts of ``source`` that the status message has, by field."""
    return read_counters((counter for counter in counters if counter.is_field), source)
