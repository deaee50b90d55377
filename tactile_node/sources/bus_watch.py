"""Watch and log bus-wide events: commands of other masters, SYNC, overload and bus load."""

import logging
from collections.abc import Callable, Sequence
from typing import NamedTuple

from tactile_node.assembly.facts import BusFacts
from tactile_node.assembly.fault_text import load_text, sync_text
from tactile_node.assembly.health import Overload, SyncFault, SyncState
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.load import MOST_LOAD, planned_load
from tactile_node.bus.log_throttle import LogThrottle
from tactile_node.skin.pads import LivePad

logger = logging.getLogger(__name__)


class BusCounts(NamedTuple):
    """SYNC counts of the bus so far, and the overload of this process."""

    syncs: int
    foreign_syncs: int = 0  #: number of SYNCs from other devices while this driver produces SYNC
    is_overloaded: bool = False  #: True if this process is too slow to count all messages
    ran_again: float = 0.0  #: time when this process resumed after a stall [s]; earlier messages may still be waiting


class OverloadWatch:
    """Detects overload of this process. During overload, data that seem to be missing may still be waiting in a queue.

    Parameters
    ----------
    put
        Posts a call to the chain, behind the messages received so far.
    limit
        Delay above which the process counts as overloaded [s]. The overload ends after 2 ``limit`` without any sign of
        overload.
    """

    def __init__(self, put: Callable[[Callable[[], None]], None], limit: float):
        self._put = put
        self.limit = limit
        self._put_at: float | None = None  # time when the pending call was queued
        self._dropped = 0
        self.kind = Overload.NOT_KNOWN
        self._seen = -float('inf')  # time of the last sign of overload
        self._excused = -float('inf')  # time of the last long wait for another thread
        self.ran_again = 0.0  #: time when the last stall, or long wait for another thread, ended
        self.stalls = 0  #: number of times that this process was stalled for more than ``limit``

    def restart(self) -> None:
        """Forget the pending call, because the bus has been closed."""
        self._put_at = None

    def woke(self, now: float, late: float) -> None:
        """Record that a wait of this process ended ``late`` [s] too late."""
        if late > self.limit:
            self.stalls += 1
            self.ran_again = now
            self._see(Overload.STALLED, now)

    def waited(self, now: float, since: float) -> None:
        """Record that this process waited ``since`` [s] for another thread, and may not have run meanwhile.

        Waiting for another thread is not overload, but counts and periods cannot be measured during the wait.
        """
        if since > self.limit:
            self._excused = self.ran_again = now

    def is_excused(self, now: float) -> bool:
        """Return True if data that seem to be missing may still be waiting in a queue."""
        return self.kind.is_fault or now - self._excused <= 2 * self.limit

    def update(self, now: float, dropped: int) -> Overload:
        """Return the current kind of overload. ``dropped`` is the number of CAN frames dropped so far."""
        if dropped != self._dropped:
            self._dropped = dropped
            self._see(Overload.DROPPED, now)
        put_at = self._put_at  # a copy, because the chain may change the attribute
        if put_at is None:
            self._put_at = now
            self._put(self._reached)
        elif now - put_at > self.limit:
            self._see(Overload.BEHIND, now)
        if now - self._seen > 2 * self.limit:
            self.kind = Overload.NONE
        return self.kind

    def _reached(self) -> None:
        self._put_at = None

    def _see(self, kind: Overload, now: float) -> None:
        self.kind, self._seen = kind, now


class SyncWatch:
    """Checks the SYNC messages on the bus. The driver does not receive the SYNCs that it sends.

    If this driver produces SYNC, every received SYNC comes from another producer. If another device produces SYNC, the
    watch measures the period of the received SYNCs. The period counts as wrong only after two consecutive windows with
    a wrong period, because the first window may begin before the producer starts.

    Parameters
    ----------
    produce_sync
        True if this driver produces SYNC.
    period
        Expected period of SYNC [s].
    """

    def __init__(self, produce_sync: bool, period: float):
        self._produce_sync = produce_sync
        self._period = period
        self._received = 0
        self._foreign_at: float | None = None
        self._begun: tuple[float, int] | None = None  # start of the window, and number of SYNCs received by then
        self._was_other = False
        self.state = SyncState()

    def update(self, now: float, is_active: bool, received: int) -> SyncState:
        """Return the state of SYNC. ``received`` is the number of SYNCs received so far."""
        new, self._received = received - self._received, received
        if not is_active:
            self._begun, self._was_other = None, False
            self.state = self.state._replace(fault=SyncFault.NOT_KNOWN)
        elif self._produce_sync:
            self._count(now, new)
        else:
            self._measure(now, received)
        return self.state

    def _count(self, now: float, new: int) -> None:
        if new:
            self._foreign_at = now
        is_foreign = self._foreign_at is not None and now - self._foreign_at <= 1.0
        self.state = SyncState(SyncFault.SECOND_PRODUCER if is_foreign else SyncFault.NONE, self.state.foreign + new)

    def _measure(self, now: float, received: int) -> None:
        begun, before = self._begun = self._begun or (now, received)
        if now - begun < max(1.0, 20 * self._period):
            return
        self._begun = (now, received)
        if received == before:
            self._was_other = False
            return  # the node monitors report a missing SYNC
        period = (now - begun) / (received - before)
        is_other = abs(period - self._period) > 0.2 * self._period  # 20 SYNCs give the period to within 5 %
        fault = SyncFault.OTHER_PERIOD if is_other and self._was_other else SyncFault.NONE
        self.state, self._was_other = SyncState(fault, period=period), is_other


class BusWatch:
    """Watches one bus.

    Parameters
    ----------
    settings
        Settings of the bus.
    pads
        Pads on the bus.
    monitor
        Monitor that counts all messages received on the bus.
    put
        Posts a call to the chain.
    data_timeout
        Maximum time for which a node may go without sending data [s].
    """

    def __init__(self, settings: BusSettings, pads: Sequence[LivePad], monitor: BusMonitor,
                 put: Callable[[Callable[[], None]], None], data_timeout: float):
        self._monitor = monitor
        self._is_producer = settings.produce_sync
        self._needs_sync = any(pad.layout.needs_sync for pad in pads)
        self._pads = len(pads)
        self._planned_load = planned_load((pad.layout for pad in pads), settings.bitrate, settings.sync_period)
        self._bitrate = settings.bitrate
        # start of the load window, and number of bits by then
        self._window: tuple[float, int] | None = None
        #: bus load from 0 to 1 in the last complete window, with worst-case bit stuffing; the actual load is about a
        #: fifth lower
        self.load = 0.0
        self.sync = SyncWatch(settings.produce_sync, settings.sync_period)
        self.overload = OverloadWatch(put, data_timeout / 2)
        self._commands_reported = 0
        self._command_throttle = LogThrottle()
        self._sync_throttle = LogThrottle()
        self._overload_throttle = LogThrottle()

    def opened(self) -> None:
        """Log a warning at the first opening of the bus if the planned bus load is high."""
        if self._planned_load > MOST_LOAD:
            logger.warning('With the given layouts and sync_period, %s. Raise sync_period, or move some pads to '
                           'another bus.',
                           load_text(self._planned_load, self._pads), extra={'fact': self._planned_load})

    def look_at_traffic(self, now: float) -> None:
        """Update the bus load, and log commands of other masters."""
        bits = self._monitor.bits
        begun, before = self._window = self._window or (now, bits)
        if now - begun >= 1.0:
            self.load = (bits - before) / self._bitrate / (now - begun)
            self._window = now, bits
        count, command = self._monitor.foreign_commands, self._monitor.last_command
        if count != self._commands_reported and self._command_throttle.is_due('NMT', now):
            self._commands_reported = count
            logger.error('Another NMT master has sent a command: %s.', command, extra={'fact': command})

    def look_at_counts(self, now: float, is_active: bool, counts: BusFacts, syncs_sent: int) -> BusCounts:
        """Update the SYNC and overload states, log faults, and return the counts that the node monitors need."""
        received = counts.can_frames.get('sync', 0)
        if self._needs_sync:
            self.sync.update(now, is_active, received)
        sync, overload = self.sync.state, self.overload.update(now, counts.queue_overruns)
        if sync.fault.is_fault and self._sync_throttle.is_due(sync.fault.name, now):
            logger.error('%s.', sync_text(sync), extra={'fact': sync.fault})
        if overload.is_fault and self._overload_throttle.is_due(overload.name, now):
            logger.error('This process is overloaded: %s.', overload.phrase, extra={'fact': overload})
        syncs = syncs_sent if self._is_producer else received
        return BusCounts(syncs, sync.foreign, self.overload.is_excused(now), self.overload.ran_again)
