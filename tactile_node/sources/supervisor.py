"""Supervise a skin bus: detect faults of the bus and its nodes, recover from them, and log what is still missing.

Supervision has two levels. If a bus fails (adapter gone, network down, bus-off), the supervisor closes and reopens the
bus, including its reception and its queue, until the bus works. If a node has restarted, is silent, is not OPERATIONAL
or sends no taxels, `SupervisedNode` reconfigures and restarts the node, while SYNC and the other pads continue. On both
levels, the pause between two attempts doubles each time.
"""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import TypeVar

from tactile_node.assembly.facts import BusFacts
from tactile_node.assembly.health import Failure, Outages
from tactile_node.assembly.router import OnFrame
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.bus_settings import BusSettings
from tactile_node.bus.log_throttle import LogThrottle
from tactile_node.bus.skin_bus import SkinBus
from tactile_node.chain import Chain
from tactile_node.errors import BusError, LogError
from tactile_node.skin.pads import LivePad
from tactile_node.sources.bus_watch import BusWatch
from tactile_node.sources.node_monitor import NodeMonitor
from tactile_node.sources.node_state import NodeEvent, Retries
from tactile_node.sources.node_trust import deliver_trusted
from tactile_node.sources.supervised_node import SupervisedNode
from tactile_node.threads import ReportedThread

logger = logging.getLogger(__name__)

Result = TypeVar('Result')

ROUND_PERIOD = 0.02  #: period of supervision rounds if nothing wakes the supervisor earlier [s]


class Supervisor:
    """A SkinBus that recovers from faults. The class implements FrameSource, which defines the order of calls.

    ``open``, ``configure`` and ``start`` raise the errors of SkinBus, so the caller must handle a bus or device that is
    missing at the start. However, if at least one of several nodes answers, absent nodes are only logged. Absent nodes
    join when they answer.

    Parameters
    ----------
    settings
        Settings of the bus.
    pads
        Pads on the bus.
    on_frame
        Called with each taxel frame.
    recover
        True to recover from faults, False to only detect and log faults.
    heartbeat_timeout
        Maximum time without a heartbeat [s]. The timeout also applies to a node that has never sent a heartbeat.
    chain
        Running chain that assembles the frames, or None if the bus must start a separate chain.
    """

    def __init__(self, settings: BusSettings, pads: tuple[LivePad, ...], on_frame: OnFrame,
                 recover: bool = True, heartbeat_timeout: float = 0.5, chain: Chain | None = None):
        self._settings = settings
        self._recover = recover
        self._wake = threading.Event()
        self._closing = threading.Event()
        self._turn = threading.RLock()
        self.bus_monitor = BusMonitor([node_id for pad in pads for node_id in pad.node_ids], self._wake.set)
        timeouts = self._timeouts(heartbeat_timeout)
        monitors = {pad.name: [NodeMonitor(node, self.bus_monitor, *timeouts) for node in pad.nodes] for pad in pads}
        trusts = {pad: [monitor.trust for monitor in of_pad] for pad, of_pad in monitors.items()}
        self._bus = SkinBus(settings, pads, partial(deliver_trusted, trusts, on_frame), monitor=self.bus_monitor,
                            on_failure=self._bus_failed if recover else None, chain=chain)
        self._by_pad = {pad: [SupervisedNode(self._bus, monitor, recover) for monitor in of_pad]
                        for pad, of_pad in monitors.items()}
        self._nodes = [node for nodes in self._by_pad.values() for node in nodes]
        self._watch = BusWatch(settings, pads, self.bus_monitor, self._bus.queue.chain.post, data_timeout=timeouts[1])
        self._outages: Outages[Failure] = Outages()  # outages of the bus
        self._retries = Retries()  # attempts to reopen the bus
        self._throttle = LogThrottle()
        self._received_then = 0  # number of CAN frames received before the bus was reopened
        self._silent_since: float | None = None  # time of the disconnection, after which no SYNC was sent
        self._is_configured = False
        self._is_active = False
        self._thread: threading.Thread | None = None

    @property
    def failure(self) -> Failure | None:
        """Reason why nothing is received, or None while the bus works."""
        return self._outages.current or self._bus.failure

    def open(self) -> None:
        with self._turn:
            self._bus.open()
            if self._thread is None:
                self._watch.opened()
                now = time.monotonic()
                self._outages = self._outages.end(now)
                self._retries = Retries()
                self._watch.overload.restart()
                for node in self._nodes:
                    node.handle(NodeEvent.STOPPED, now)
                    node.monitor.expect(now)
                self._closing.clear()
                self._thread = ReportedThread(self._supervise, 'supervisor')
                self._thread.start()

    def configure(self) -> None:
        with self._turn:
            found = _at_once(self._nodes, lambda node: node.configure(self._settings.boot_timeout))
            absent = [error for error in found if error is not None]
            if absent and (not self._recover or len(absent) == len(self._nodes)):
                raise absent[0]
            for error in absent:
                logger.error('%s The other nodes continue. This node joins when it answers.', error,
                             extra={'fact': error})
            self._is_configured = True

    def start(self) -> None:
        with self._turn:
            if self._outages.current is not None:
                raise BusError('CAN bus', expected='a working bus', got=str(self.failure),
                               remedy='Wait until the driver has reopened the bus, then start again.')
            self._silent_since = None  # the sequence starts again, so it skips no period of an earlier outage
            self._bus.start(without=[node.node_id for node in self._nodes if not node.monitor.trust.is_trusted])
            self._set_active(True)

    def stop(self) -> None:
        self._is_active = False
        self._bus.devices.interrupt()
        with self._turn:
            self._bus.stop()
            self._set_active(False)

    def close(self) -> None:
        self._closing.set()
        self._bus.devices.interrupt()
        self._wake.set()
        with self._turn:
            self._is_configured = self._is_active = False
            thread, self._thread = self._thread, None
        if thread is not None and thread is not threading.current_thread():
            thread.join()
        self._bus.close()

    def auto_zero(self, pad: str) -> int:
        return self._bus.devices.auto_zero(pad)

    def boots(self, pad: str) -> int:
        return sum(node.monitor.boots for node in self._by_pad[pad])

    def adjust(self, drop_incomplete: bool, heartbeat_timeout: float) -> None:
        self._bus.withhold_incomplete(drop_incomplete)
        timeouts = self._timeouts(heartbeat_timeout)
        self._watch.overload.limit = timeouts[1] / 2
        for node in self._nodes:
            node.monitor.set_timeouts(*timeouts)

    def facts(self) -> BusFacts:
        counted, now, monitor, watch = self._bus.facts(), time.monotonic(), self.bus_monitor, self._watch
        outages, sync = self._outages.until(now), watch.sync.state
        return replace(
            counted, failure=self.failure, active=self._is_active,
            pads=tuple(replace(pad, nodes=tuple(node.facts(now) for node in self._by_pad[pad.pad]))
                       for pad in counted.pads),
            outages=outages.count, outage_seconds=outages.seconds, outage_last_reason=outages.cause,
            bus_load=watch.load, error_passive=monitor.is_error_passive,
            tx_error_count=monitor.error_counters.tx, rx_error_count=monitor.error_counters.rx,
            foreign_nmt_commands=monitor.foreign_commands,
            foreign_nmt_last=monitor.last_command, sync_fault=sync.fault, foreign_syncs=sync.foreign,
            sync_period=sync.period, overload=watch.overload.kind, stalls=watch.overload.stalls)

    def _timeouts(self, heartbeat_timeout: float) -> tuple[float, float]:
        """Return the timeouts for heartbeats and for taxels [s]."""
        return heartbeat_timeout, max(heartbeat_timeout, 5 * self._settings.sync_period)

    def _set_active(self, is_active: bool) -> None:
        now, counts = time.monotonic(), self._bus.facts()
        for node in self._nodes:
            node.monitor.commanded(now, counts.pad(node.pad))
            if not is_active:
                node.handle(NodeEvent.STOPPED, now)
        self._is_active = is_active

    def _supervise(self) -> None:
        ended = time.monotonic()
        while not self._closing.is_set():
            self._wake.wait(ROUND_PERIOD)
            woken = time.monotonic()
            self._wake.clear()
            with self._turn:
                self._watch.overload.waited(time.monotonic(), time.monotonic() - woken)
                ended = time.monotonic() if self._closing.is_set() else self._attend(woken - ended - ROUND_PERIOD)

    def _attend(self, late: float) -> float:
        """Run one supervision round, which began ``late`` [s] after it was due. Exceptions are logged, but not raised.

        Returns
        -------
        float
            Time at which the bus was checked, or at which a recovery ended [s].
        """
        try:
            self._watch.look_at_traffic(time.monotonic())
            if not self._is_configured:
                return time.monotonic()
            if self._recover and (self._bus.failure is not None or self._outages.current is not None):
                self._attend_to_bus()
                self._watch.overload.restart()
            if self._bus.failure is None:
                begun, counts, syncs = time.monotonic(), self._bus.facts(), self._bus.sync.sent
                now = time.monotonic()  # a single reading, so that a backlog after a stall does not count as silence
                self._watch.overload.woke(now, late + now - begun)
                seen = self._watch.look_at_counts(now, self._is_active, counts, syncs)
                due = [node for node in self._nodes
                       if node.look(now, self._is_active, counts.pad(node.pad), seen)]
                if not due:
                    return now
                _at_once(due, SupervisedNode.recover)
        except Exception:
            logger.exception('The supervision of the bus raised an unexpected error.')
        return time.monotonic()

    def _bus_failed(self, failure: Failure) -> None:
        """Log the failure once and wake the supervisor. Any thread may call this method."""
        if self._outages.current is None:
            logger.error('The CAN bus has failed: %s. The driver will reopen the bus until it works.',
                         failure, extra={'fact': failure.fault})
        self._wake.set()

    def _attend_to_bus(self) -> None:
        now, failure = time.monotonic(), self._bus.failure
        if failure is None:
            if self.bus_monitor.can_frames > self._received_then:
                ended = self._outages.end(now)
                logger.info('The CAN bus works again after %.2f s.', ended.seconds - self._outages.seconds)
                self._outages = ended
                self._retries = Retries()
            return
        self._outages = self._outages.begin(now, failure)
        for node in self._nodes:
            node.handle(failure, now)
        if self._retries.is_due(now):
            self._reopen()
            self._retries = self._retries.attempted(time.monotonic())

    def _reopen(self) -> None:
        """Reopen the bus with a new reception thread and queue. The counts continue."""

        self._bus.disconnect()
        self._silent_since = self._silent_since or time.monotonic()
        try:
            self._bus.open()
            self._received_then = self.bus_monitor.can_frames
            if self._is_active:
                self._bus.resume(int((time.monotonic() - self._silent_since) / self._settings.sync_period))
                self._silent_since = None
        except (BusError, LogError) as error:
            if self._throttle.is_due(str(error), time.monotonic()):
                logger.error('Waiting for the CAN bus: %s', error, extra={'fact': error})
            return
        for node in self._nodes:
            node.monitor.expect(time.monotonic())


def _at_once(nodes: Sequence[SupervisedNode], act: Callable[[SupervisedNode], Result]) -> list[Result]:
    """Call ``act`` for all nodes in parallel. Return the results in order, or raise the first error at the end.

    An SDO transfer spends most of its time waiting for the device, and an absent device must not delay other devices.
    """
    if len(nodes) < 2:
        return [act(node) for node in nodes]
    with ThreadPoolExecutor(len(nodes), 'configure') as pool:
        return list(pool.map(act, nodes))
