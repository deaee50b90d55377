"""The CAN frames of one bus on their way to the assembler: stamped, counted, put into its queue."""

import logging
import threading
import time
from collections import Counter
from collections.abc import Callable, Collection
from math import inf
from queue import Empty, SimpleQueue

import can

from tactile_node.assembly.free_bus import SyncPause
from tactile_node.assembly.health import BusFault
from tactile_node.assembly.router import Router, non_data_kind
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.bus_network import BusNetwork, OnFailure
from tactile_node.bus.reception import Batch
from tactile_node.bus.stamp_clock import StampClock
from tactile_node.cia301.objects import SDO_REQUEST
from tactile_node.errors import BusError
from tactile_node.threads import ReportedThread, call_guarded

logger = logging.getLogger(__name__)

Call = tuple[Callable[..., object], tuple[object, ...]]

LONGEST_WRITE = 0.1  #: s that the assembler waits for the end of a SYNC's write
NO_DATA = -1  #: in place of the COB-ID of what is no data frame with an 11-bit identifier


class Traffic:
    """Puts what is received, and what is sent and concerns the assembler, into the queue of ``router``'s thread.

    That thread makes the calls in their order, between ``begin`` and ``end``.
    ``polled``: node-IDs whose SDO requests the assembler needs to know.
    """

    def __init__(self, router: Router, monitor: BusMonitor, on_failure: OnFailure, *, polled: Collection[int],
                 queue_limit: int, is_host_stamped: bool, sync_period: float):
        self._router = router
        self._monitor = monitor
        self._on_failure = on_failure
        self._polled = polled
        self._queue_limit = queue_limit
        self._queue: SimpleQueue[Call | None] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self.clock = StampClock(is_host_stamped)
        self._jumps_reported = 0
        self.no_data_frames: Counter[str] = Counter()  #: received, that are no data frames, by kind
        self._put = self._fed = 0  # CAN frames put into the queue, and taken from it
        self.overruns = 0  #: data frames lost because the queue was full; what else came with them is in no_data_frames
        self.syncs_sent = 0
        self.pause = SyncPause(sync_period)
        self._last_came = -inf  # the stamp up to which all received so far has come
        self._is_gap = True  # nothing is known of the time before the next batch
        self._read_at = 0.0  # by the steady clock, the last batch

    def begin(self) -> None:
        """Start the assembler's thread; what waited for it is forgotten, also by one that still hangs in a call."""
        self._put = self._fed = 0
        self._is_gap = True
        self._queue = SimpleQueue()
        self._thread = ReportedThread(self._work, 'assembler', self._queue)
        self._thread.start()

    def end(self, timeout: float) -> None:
        """End it, after the calls put so far; waits at most ``timeout`` [s]."""
        self._queue.put(None)
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout)

    def restart(self) -> None:
        """Sequence numbers begin at 0, and stamps follow the wall clock."""
        self.clock.restart()
        self.pause.restart()
        self.put(self._router.restart)

    def put(self, call: Callable[..., object], *args: object) -> None:
        """Make a call on the assembler's thread, after what was received before. From any thread; returns at once."""
        self._queue.put((call, args))

    def received(self, batch: Batch) -> None:
        """On the thread of the reception: copy, enqueue, return."""
        is_gap, self._is_gap = self._is_gap, True  # until this batch is in the queue
        frames = []
        for message in batch.messages:
            kind = non_data_kind(message)
            if kind is None:
                can_id, data = message.arbitration_id, bytes(message.data)
                self._monitor.feed(can_id, data)
                frames.append((can_id, data, self.clock.of(message.timestamp)))
            else:
                self._count_other(kind, message)
                came = inf if message.is_error_frame else self.clock.of(message.timestamp)  # more errors may be unseen
                frames.append((NO_DATA, b'', came))
        if self._put - self._fed + len(frames) <= self._queue_limit:
            self._put += len(frames)
            self.put(self._feed, frames, self._came(batch), self._most_free(batch, is_gap))
            self._is_gap = False
        else:
            self.overruns += sum(can_id != NO_DATA for can_id, _, _ in frames)

    def _work(self, queue: 'SimpleQueue[Call | None]') -> None:
        while (item := queue.get()) is not None and queue is self._queue:
            call, args = item
            call_guarded(call, *args)

    def _came(self, batch: Batch) -> tuple[float, float] | None:
        """Between which stamps the frames of ``batch`` came; None where each has the stamp at which it came."""
        if batch.came is None:
            return None
        lead = self.clock.now() - time.monotonic()
        after, until = batch.came
        return after + lead, until + lead

    def _most_free(self, batch: Batch, is_gap: bool) -> float:
        """For how long the bus was free at most before any frame of ``batch`` [s], by the steady clock.

        0 for ``is_gap``: CAN frames before it were not taken.
        """
        after, read = batch.came or (time.monotonic(),) * 2
        before, self._read_at = self._read_at, read
        return 0.0 if is_gap else max(0.0, after - before)

    def _feed(self, frames: list[tuple[int, bytes, float]], came: tuple[float, float] | None, most_free: float) -> None:
        """On the assembler's thread. Time that stamps have and the steady clock has not is none of a free bus."""
        self._fed += len(frames)
        for can_id, data, stamp in frames:
            if stamp == inf:
                self._router.bus.occupy(inf, inf)
                continue
            after, until = came or (stamp, stamp)
            self._router.bus.occupy(after, max(0.0, after - self._last_came - most_free))
            self._last_came = until
            if can_id == NO_DATA:
                self._router.bus.occupy(stamp)
            else:
                self._router.feed(can_id, data, stamp, after)

    def _count_other(self, kind: str, message: can.Message) -> None:
        self.no_data_frames[kind] += 1
        if not message.is_error_frame:
            self._monitor.feed_other(message)
        elif self._monitor.feed_error(message):
            self._on_failure(BusFault.BUS_OFF, BusError(
                'CAN controller', expected='a bus it can send on', got='bus-off',
                remedy='Check bit rate, wiring and termination; set restart-ms on socketcan.'))

    def sent(self, can_id: int, data: bytes) -> None:
        """An own frame is about to be sent: it counts for the load; the assembler needs the polls' SDO requests."""
        self._monitor.feed_own(len(data))
        if can_id - SDO_REQUEST in self._polled:
            self.put(self._router.feed, can_id, bytes(data), self.clock.now())

    def send_sync(self, network: BusNetwork, can_id: int) -> None:
        """The SYNC is put into the queue before it is on the bus: no TPDO can overtake it. Raises BusError.

        It was on the bus between the times before and after its write.
        """
        if self.pause.is_due(self._router.is_in_doubt):
            return
        written: SimpleQueue[float] = SimpleQueue()

        def announce() -> float:
            stamp = self.clock.now()
            self.put(self._begin_period, stamp, written)
            return stamp - self.clock.ahead
        self.syncs_sent += 1
        try:
            network.send_message(can_id, b'', announce=announce)
        finally:
            written.put(self.clock.now())
        if self.clock.jumps != self._jumps_reported:
            self._report_jump()

    def _begin_period(self, stamp: float, written: SimpleQueue[float]) -> None:
        """On the assembler's thread: no answer to a SYNC is used before it is known how long its write took."""
        try:
            late = written.get(timeout=LONGEST_WRITE) - stamp
        except Empty:
            late = inf
        self._router.sync(stamp, late)

    def _report_jump(self) -> None:
        self._jumps_reported = self.clock.jumps
        ahead = self.clock.ahead
        if ahead:
            logger.error('The wall clock was set. Stamps continue from the old time, %.3f s ahead of it, so that they '
                         'never go back; deactivate and activate the driver to take the new one.', ahead)
        else:
            logger.error('The wall clock was set. Stamps follow it.')
