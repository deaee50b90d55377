"""Keeps a skin bus going: judges bus and nodes, mends what has failed, and says what it waits for.

Two levels. A *bus* that fails (adapter gone, network down, bus-off) is closed and opened anew, with all that
belongs to it: here. A *node* that has started anew, is silent, not OPERATIONAL or without taxels is configured and
started again, while SYNC and the other pads go on: NodeRecovery. Between two attempts of either kind the pause doubles.
"""

import logging
import threading
import time

from tactile_node.bus.bus_load import BusLoad
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.skin_bus import SkinBus
from tactile_node.errors import BusError, LogError
from tactile_node.frames.consumer import OnFrame
from tactile_node.frames.health import BusHealth
from tactile_node.frames.losses import BusStatistics
from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.skin.pads import LivePad
from tactile_node.skin.taxel_codec import without_values
from tactile_node.supervision.node_monitor import NodeMonitor
from tactile_node.supervision.node_recovery import NodeRecovery
from tactile_node.supervision.outage import Backoff, OutageClock
from tactile_node.threads.reminder import Reminder

logger = logging.getLogger(__name__)

PERIOD = 0.02  # s between two judgements when nothing asks for one earlier


class Supervisor:
    """A SkinBus that mends itself. Implements FrameSource; see there for the order of calls.

    With ``recover=False`` nothing is mended, all is judged and told. ``heartbeat_timeout`` [s] counts also for a
    node never heard. ``open``, ``configure`` and ``start`` raise what SkinBus raises: a bus or device that is
    not there from the beginning is the caller's matter. But while one pad of several is there, the absent ones are
    told, and join when they come.
    """

    def __init__(self, settings: BusSettings, pads: tuple[LivePad, ...], on_frame: OnFrame,
                 recover: bool = True, heartbeat_timeout: float = 0.5):
        self._settings, self._on_frame, self._recover = settings, on_frame, recover
        self._wake, self._closing, self._turn = threading.Event(), threading.Event(), threading.RLock()
        self.monitor = BusMonitor([node_id for pad in pads for node_id in pad.node_ids], self._wake.set)
        self._bus = SkinBus(settings, pads, self._deliver, self.monitor,
                            self._bus_failed if recover else None)
        timeouts = self._timeouts(heartbeat_timeout)
        self._by_pad = {pad.name: [NodeMonitor(node, self.monitor, *timeouts) for node in pad.nodes] for pad in pads}
        self._nodes = [node for nodes in self._by_pad.values() for node in nodes]
        self._care = NodeRecovery(self._bus, self._nodes, recover)
        self._outage, self._backoff = OutageClock(), Backoff()
        self._reminder, self._others = Reminder(), Reminder()
        self._load = BusLoad(settings.bitrate)
        self._is_configured = self._is_active = False
        self._heard_then = self._commands_told = 0
        self._silent_since: float | None = None  # no SYNC, so no sequence numbers, since then
        self._thread: threading.Thread | None = None

    @property
    def failure(self) -> str | None:
        """Why nothing is received, None while the bus works."""
        return self._outage.reason if self._outage.is_running else self._bus.failure

    def open(self) -> None:
        with self._turn:
            self._bus.open()
            if self._thread is None:
                self._begin()
                self._closing.clear()
                self._thread = threading.Thread(target=self._supervise, name='supervisor', daemon=True)
                self._thread.start()

    def configure(self) -> None:
        with self._turn:
            self._care.configure(self._settings.boot_timeout)
            self._is_configured = True

    def start(self) -> None:
        with self._turn:
            if self._outage.is_running:
                raise BusError('CAN bus', expected='one that works', got=self._outage.reason,
                               remedy='It is opened again until it works; start once it does.')
            self._bus.start(without=[node.node.node_id for node in self._nodes if not node.is_trusted])
            self._set_active(True)

    def stop(self) -> None:
        self._is_active = False
        with self._turn:
            self._bus.stop()
            self._set_active(False)

    def close(self) -> None:
        self._closing.set()
        self._wake.set()
        with self._turn:
            self._is_configured = self._is_active = False
            thread, self._thread = self._thread, None
        if thread not in (None, threading.current_thread()):
            thread.join()
        self._bus.close()

    def auto_zero(self, pad: str) -> int:
        return self._bus.auto_zero(pad)

    def boots(self, pad: str) -> int:
        return sum(node.boots for node in self._by_pad[pad])

    def adjust(self, drop_incomplete: bool, heartbeat_timeout: float) -> None:
        self._bus.drop_incomplete(drop_incomplete)
        for node in self._nodes:
            node.set_timeouts(*self._timeouts(heartbeat_timeout))

    def statistics(self) -> BusStatistics:
        return self._bus.statistics()

    def health(self) -> BusHealth:
        """State of the bus and its nodes now."""
        now, monitor = time.monotonic(), self.monitor
        nodes = {name: tuple(node.health(now) for node in nodes) for name, nodes in self._by_pad.items()}
        return BusHealth(self.failure, self._is_active, nodes, self._outage.outages(now), self._load.load,
                         monitor.is_error_passive, monitor.error_counters, monitor.foreign_commands,
                         monitor.last_command)

    def _timeouts(self, heartbeat_timeout: float) -> tuple[float, float]:
        """Of heartbeat and of taxels [s]."""
        return heartbeat_timeout, max(heartbeat_timeout, 5 * self._settings.sync_period)

    def _begin(self) -> None:
        now = time.monotonic()
        for clock in (self._outage, *(node.outage for node in self._nodes)):
            if clock.is_running:
                clock.end(now)
        for node in self._nodes:
            node.expect(now)
        self._silent_since = None

    def _set_active(self, is_active: bool) -> None:
        now, pads = time.monotonic(), self.statistics().pads
        for node in self._nodes:
            node.commanded(now, pads[node.node.pad])
            if not is_active and node.outage.is_running:
                node.outage.end(now)
        self._is_active = is_active

    def _supervise(self) -> None:
        while not self._closing.is_set():
            self._wake.wait(PERIOD)
            self._wake.clear()
            with self._turn:
                if not self._closing.is_set():
                    self._attend()

    def _attend(self) -> None:
        """One round; whatever goes wrong in it, the next one comes."""
        try:
            self._load.update(time.monotonic(), self.monitor.bits)
            self._tell_of_others()
            if not self._is_configured:
                return
            if self._recover and (self._bus.failure is not None or self._outage.is_running):
                self._attend_bus(time.monotonic())
            if self._bus.failure is None:
                statistics = self.statistics()
                syncs = self._bus.syncs_sent if self._settings.produce_sync else statistics.can_frames.get('sync', 0)
                self._care.attend(self._is_active, statistics, syncs)
        except Exception:
            logger.exception('supervision of the bus')

    def _bus_failed(self, failure: str) -> None:
        """On any thread: tell it once and let the supervisor act."""
        if not self._outage.is_running:
            logger.error('CAN bus has failed: %s. It is closed and opened again until it works.', failure.rstrip('.'))
        self._wake.set()

    def _attend_bus(self, now: float) -> None:
        failure = self._bus.failure
        if failure is None:
            if self.monitor.can_frames > self._heard_then:
                logger.info('CAN bus works again after %.2f s.', self._outage.end(now))
                self._backoff.reset()
            return
        self._outage.begin(now, failure)
        for node in self._nodes:
            node.outage.begin(now, f'the bus has failed: {failure}')
        if self._backoff.is_due(now):
            self._reopen()
            self._backoff.attempted(time.monotonic())

    def _reopen(self) -> None:
        """Everything anew: bus, notifier, queue; the counts go on."""
        self._bus.disconnect()
        self._silent_since = self._silent_since or time.monotonic()
        try:
            self._bus.open()
            self._heard_then = self.monitor.can_frames
            if self._is_active:
                self._bus.resume(int((time.monotonic() - self._silent_since) / self._settings.sync_period))
                self._silent_since = None
        except (BusError, LogError) as error:
            if self._reminder.is_due(str(error), time.monotonic()):
                logger.error('Waiting for the CAN bus: %s', error)
            return
        for node in self._nodes:
            node.expect(time.monotonic())

    def _tell_of_others(self) -> None:
        if self.monitor.foreign_commands != self._commands_told and self._others.is_due('NMT', time.monotonic()):
            self._commands_told = self.monitor.foreign_commands
            logger.error('Another NMT master has told %s.', self.monitor.last_command)

    def _deliver(self, name: str, frame: TaxelFrame) -> None:
        for node in self._by_pad[name]:
            if not node.is_trusted:
                node.distrusted += 1
                frame = without_values(frame, node.node.layout.carriers)
        self._on_frame(name, frame)
