"""Watches what happens on a bus beside its nodes' own matters, and logs it: other masters, SYNC, overload, load."""

import logging
from collections.abc import Callable, Sequence

from tactile_node.bus.bus_load import BusLoad
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.planned_load import MOST_LOAD, planned_load
from tactile_node.frames.fault_text import OVERLOAD_PHRASES, command_text, load_text, sync_text
from tactile_node.frames.health import Overload, SyncState
from tactile_node.frames.losses import BusStatistics
from tactile_node.skin.pads import LivePad
from tactile_node.supervision.node_traffic import BusSeen
from tactile_node.supervision.overload import OverloadWatch
from tactile_node.supervision.sync_watch import SyncWatch
from tactile_node.threads.reminder import Reminder

logger = logging.getLogger(__name__)


class BusWatch:
    """``put`` makes a call on the assembler's thread; ``data_timeout`` [s]: how long a node may be without data."""

    def __init__(self, settings: BusSettings, pads: Sequence[LivePad], monitor: BusMonitor,
                 put: Callable[[Callable[[], None]], None], data_timeout: float):
        self._monitor = monitor
        self._is_producer = settings.produce_sync
        self._needs_sync = any(pad.layout.needs_sync for pad in pads)
        self._pads = len(pads)
        self._planned_load = planned_load((pad.layout for pad in pads), settings.bitrate, settings.sync_period)
        self._load = BusLoad(settings.bitrate)
        self._sync = SyncWatch(settings.produce_sync, settings.sync_period)
        self._overload = OverloadWatch(put, data_timeout / 2)
        self.overload = Overload.NOT_KNOWN
        self._commands_reported = 0
        self._command_reminder = Reminder()
        self._sync_reminder = Reminder()
        self._overload_reminder = Reminder()

    @property
    def load(self) -> float:
        return self._load.load

    @property
    def sync(self) -> SyncState:
        return self._sync.state

    @property
    def stalls(self) -> int:
        return self._overload.stalls

    def set_timeout(self, data: float) -> None:
        """How long a node may be without data [s]."""
        self._overload.limit = data / 2

    def opened(self) -> None:
        """The bus was opened for the first time: log what its pads ask of it, where that is much."""
        if self._planned_load > MOST_LOAD:
            logger.warning('By layouts and sync_period %s. Raise sync_period, or give some of them another bus.',
                           load_text(self._planned_load, self._pads), extra={'fact': self._planned_load})

    def closed(self) -> None:
        """The bus is closed, or does not work."""
        self._overload.restart()

    def woke(self, now: float, late: float) -> None:
        """See OverloadWatch."""
        self._overload.woke(now, late)

    def waited(self, now: float, since: float) -> None:
        """See OverloadWatch."""
        self._overload.waited(now, since)

    def look_at_traffic(self, now: float) -> None:
        """Take what all that is received says of load and of other masters."""
        self._load.update(now, self._monitor.bits)
        count, command = self._monitor.foreign_commands, self._monitor.last_command
        if count != self._commands_reported and self._command_reminder.is_due('NMT', now):
            self._commands_reported = count
            logger.error('Another NMT master has sent: %s.', command_text(command), extra={'fact': command})

    def look_at_counts(self, now: float, is_active: bool, statistics: BusStatistics, syncs_sent: int) -> BusSeen:
        """Take what is counted of SYNC and of frames not processed yet; what it means for the nodes."""
        received = statistics.can_frames.get('sync', 0)
        if self._needs_sync:
            self._sync.update(now, is_active, received)
        if self.sync.fault.is_fault and self._sync_reminder.is_due(self.sync.fault.name, now):
            logger.error('%s.', sync_text(self.sync), extra={'fact': self.sync.fault})
        self.overload = self._overload.update(now, statistics.queue_overruns)
        if self.overload.is_overload and self._overload_reminder.is_due(self.overload.name, now):
            logger.error('This process is overloaded: %s.', OVERLOAD_PHRASES[self.overload],
                         extra={'fact': self.overload})
        syncs = syncs_sent if self._is_producer else received
        return BusSeen(syncs, self.sync.foreign, self._overload.is_excused(now), self._overload.ran_again)
