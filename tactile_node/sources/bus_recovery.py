"""Closes and opens a failed bus until it works again, with all that belongs to it."""

import logging
import time
from collections.abc import Callable, Sequence

from tactile_node.assembly.fault_text import failure_text
from tactile_node.assembly.health import Failure
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.skin_bus import SkinBus
from tactile_node.bus.threads import Reminder
from tactile_node.errors import BusError, LogError
from tactile_node.sources.node_monitor import NodeMonitor
from tactile_node.sources.outage import Backoff, OutageClock

logger = logging.getLogger(__name__)


class BusRecovery:
    """Recovers ``bus``; called by one thread at a time, except ``failed``. ``is_active()``: SYNC is to be on."""

    def __init__(self, bus: SkinBus, bus_monitor: BusMonitor, monitors: Sequence[NodeMonitor], sync_period: float,
                 is_active: Callable[[], bool]):
        self._bus = bus
        self._bus_monitor = bus_monitor
        self._monitors = monitors
        self._sync_period = sync_period
        self._is_active = is_active
        self.outage: OutageClock[Failure] = OutageClock()
        self._backoff = Backoff()
        self._reminder = Reminder()
        self._received_then = 0  # CAN frames, when the bus was opened again
        self._silent_since: float | None = None  # no SYNC, so no sequence numbers, since then

    @property
    def is_needed(self) -> bool:
        return self._bus.failure is not None or self.outage.is_running

    def restart(self, now: float) -> None:
        """The bus was opened by the user."""
        self.outage.end(now)
        self._silent_since = None

    def failed(self, failure: Failure) -> None:
        """Log it once; from any thread."""
        if not self.outage.is_running:
            logger.error('CAN bus has failed: %s. It is closed and opened again until it works.',
                         failure_text(failure), extra={'fact': failure.fault})

    def attend(self) -> None:
        now, failure = time.monotonic(), self._bus.failure
        if failure is None:
            if self._bus_monitor.can_frames > self._received_then:
                logger.info('CAN bus works again after %.2f s.', self.outage.end(now))
                self._backoff.reset()
            return
        self.outage.begin(now, failure)
        for monitor in self._monitors:
            monitor.outage.begin(now, failure)
        if self._backoff.is_due(now):
            self._reopen()
            self._backoff.attempted(time.monotonic())

    def _reopen(self) -> None:
        """Bus, reception and queue are made again; the counts continue."""
        self._bus.disconnect()
        self._silent_since = self._silent_since or time.monotonic()
        try:
            self._bus.open()
            self._received_then = self._bus_monitor.can_frames
            if self._is_active():
                self._bus.resume(int((time.monotonic() - self._silent_since) / self._sync_period))
                self._silent_since = None
        except (BusError, LogError) as error:
            if self._reminder.is_due(str(error), time.monotonic()):
                logger.error('Waiting for the CAN bus: %s', error, extra={'fact': error})
            return
        for monitor in self._monitors:
            monitor.expect(time.monotonic())
