"""Stamp the CAN frames of one bus, and queue them for the chain, which assembles them."""

import time
from collections import Counter
from collections.abc import Collection
from math import inf

import can

from tactile_node.assembly.free_bus import BatchArrival
from tactile_node.assembly.health import BusFault
from tactile_node.assembly.router import Router, StampedMessage, non_data_kind
from tactile_node.bus.batch_reader import Batch
from tactile_node.bus.bus_monitor import BusMonitor
from tactile_node.bus.bus_network import OnFailure
from tactile_node.bus.stamp_clock import StampClock
from tactile_node.chain import Chain
from tactile_node.cia301.objects import SDO_REQUEST
from tactile_node.errors import BusError


class CanQueue:
    """Queues every received message, and every sent message that the assembler needs, for the chain.

    Parameters
    ----------
    router : Router
        Router that the chain feeds.
    monitor : BusMonitor
        Monitor that the reception thread feeds.
    on_failure : callable
        Function that is called with `BusFault.BUS_OFF` and an exception if the controller reports bus-off.
    polled : collection of int
        Node-IDs of polled pads. The assembler also needs the SDO requests to these nodes.
    queue_limit : int
        Largest number of CAN frames that may wait for the chain.
    clock : StampClock
        Clock that stamps the messages.
    chain : Chain or None
        Running chain of the process, or None to start a separate chain, which runs from ``begin`` to ``end``.
    """

    def __init__(self, router: Router, monitor: BusMonitor, on_failure: OnFailure, *, polled: Collection[int],
                 queue_limit: int, clock: StampClock, chain: Chain | None = None):
        self._router = router
        self._monitor = monitor
        self._on_failure = on_failure
        self._polled = polled
        self._queue_limit = queue_limit
        self.clock = clock
        #: chain that assembles the frames; a posted call runs after all messages received so far
        self.chain = chain or Chain('assembler')
        self._owns_chain = chain is None
        self._posted = 0  # CAN frames posted to the chain
        self._fed = 0  # CAN frames that the chain has fed to the router

        #: data frames lost because the queue was full, and CAN frames of any kind that the kernel has dropped
        self.overruns = 0
        self.others: Counter[str] = Counter()  #: messages without data, by kind, counted when they are received
        self._is_gap = True  # True if messages before the next batch may be missing
        self._read_at = 0.0  # time at which the last batch was read, on the steady clock

    def begin(self) -> None:
        """Begin to receive. No message before this moment belongs to a frame."""
        self._is_gap = True
        if self._owns_chain:
            self._posted = self._fed = 0
            self.chain.start()

    def end(self, timeout: float) -> None:
        """Wait up to ``timeout`` [s] until the chain has run all calls posted so far."""
        if self._owns_chain:
            self.chain.stop(timeout)
        else:
            self.chain.wait_until_idle(timeout)

    def restart(self) -> None:
        """Start the sequence numbers at 0, and let the stamps follow the wall clock."""
        self.clock.restart()
        self.chain.post(self._router.restart)

    def received(self, batch: Batch) -> None:
        """Show a batch to the monitor, stamp its messages and post them to the chain.

        The reception thread calls ``received``, so the method must return quickly.
        """
        is_gap = self._is_gap or batch.dropped > 0
        self._is_gap = True  # there is a gap, unless this batch gets into the queue
        self.overruns += batch.dropped
        stamped: list[StampedMessage] = []
        for message in batch.messages:
            kind = non_data_kind(message)
            self._observe(message, kind)
            stamped.append((message, kind, inf if message.is_error_frame else self.clock.of(message.timestamp)))
        if self._posted - self._fed + len(stamped) <= self._queue_limit:
            arrival = self._arrival(batch, is_gap)
            self._posted += len(stamped)
            self.chain.post(self._feed, stamped, arrival)
            self._is_gap = batch.dropped > 0
        else:
            self.overruns += sum(kind is None for _, kind, _ in stamped)

    def _arrival(self, batch: Batch, is_gap: bool) -> BatchArrival:
        """Return when a batch arrived. If frames before it may be missing (``is_gap``), the bus was not free."""
        now = time.monotonic()
        after, until = batch.arrival or (now, now)
        most_free = 0.0 if is_gap else max(0.0, after - self._read_at)
        self._read_at = until
        if batch.arrival is None:
            return BatchArrival(None, most_free)
        lead = self.clock.now() - time.monotonic()
        return BatchArrival((after + lead, until + lead), most_free)

    def _feed(self, stamped: list[StampedMessage], arrival: BatchArrival) -> None:
        """Feed the messages of a batch to the router, on the chain thread."""
        self._fed += len(stamped)
        self._router.feed_batch(stamped, arrival)

    def _observe(self, message: can.Message, kind: str | None) -> None:
        """Feed a message to the monitor, count it if it has no data, and report bus-off."""
        if kind is None:
            self._monitor.feed(message.arbitration_id, bytes(message.data))
            return
        self.others[kind] += 1
        if not message.is_error_frame:
            self._monitor.feed_other(message)
        elif self._monitor.feed_error(message):
            self._on_failure(BusFault.BUS_OFF, BusError(
                'CAN controller', expected='to take part in bus traffic', got='bus-off',
                remedy='Check bit rate, wiring and termination; set restart-ms on socketcan.'))

    def sent(self, can_id: int, data: bytes) -> None:
        """Count a frame that this driver is about to send, and queue it if it is an SDO request to a polled node."""
        self._monitor.feed_own(len(data))
        if can_id - SDO_REQUEST in self._polled:
            self.chain.post(self._router.feed, can_id, bytes(data), self.clock.now())
