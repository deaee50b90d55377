"""A simulated CAN wire with senders and receivers. All events depend only on the times passed to ``run``."""

import heapq
import itertools
import math
import threading
import time
from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue

from tactile_node.cia301.frame_bits import CanFrame
from tactile_node.simulator.wire import Carried, Sender, Wire, WireRecord, WireReport
from tactile_node.threads import ReportedThread, call_guarded

Receive = Callable[[Carried], None]
Call = Callable[[], None]


class Segment:
    """Delivers each CAN frame at its end to all participants except its sender, and makes calls at given wire times.

    Each participant receives the exact end time of the CAN frame, even if the computer is running late. An immediate
    response therefore takes part in the next arbitration. Times are in seconds. The class is not thread-safe.
    """

    def __init__(self, wire: Wire):
        self.wire = wire
        self.now = -math.inf  #: current time of the wire [s]
        self._receivers: list[tuple[Sender, Receive]] = []
        self._timers: list[tuple[float, int, Call]] = []
        self._count = itertools.count()

    def join(self, receive: Receive, by_priority: bool = False) -> Sender:
        """Add a participant and return its queue. ``receive`` is called with each frame of the other participants."""
        sender = self.wire.join(by_priority=by_priority)
        self._receivers.append((sender, receive))
        return sender

    def submit(self, call: Call) -> None:
        """Make a call that may queue frames or set timers. A live segment makes the call on its thread."""
        call()

    def at(self, when: float, call: Call) -> None:
        """Schedule ``call`` for the wire time ``when`` [s]."""
        heapq.heappush(self._timers, (when, next(self._count), call))

    def run(self, until: float) -> None:
        """Advance the wire to the time ``until`` [s]: transmit and deliver frames, and make due calls."""
        while True:
            due = self._timers[0][0] if self._timers else math.inf
            carried = self.wire.carry(min(until, due))
            if carried is not None:
                self.now = carried.end
                self.on_carried(carried)
                for sender, receive in self._receivers:
                    if sender is not carried.sender:
                        call_guarded(receive, carried)
            elif self._timers and due <= until:
                self.now, _, call = heapq.heappop(self._timers)
                call_guarded(call)
            else:
                self.now = max(self.now, until)
                return

    def on_carried(self, carried: Carried) -> None:
        """Process each transmitted frame before any participant receives it."""

    @property
    def next_timer(self) -> float:
        return self._timers[0][0] if self._timers else math.inf


class LiveSegment(Segment):
    """A segment that runs in a thread from ``start`` to ``stop``, with wire times from time.monotonic.

    ``submit``, ``send`` and ``report`` may be called from any thread.

    Parameters
    ----------
    wire
        Model of the wire.
    hand_over
        Called with the frames that the host receives, in order.
    lost
        Function that returns the number of delivered frames that the host has not read.
    batch
        Maximum time for which a frame waits to be delivered together with later frames [s].
    is_shared
        True if several hosts are connected, each with its own CAN controller.
    """

    def __init__(self, wire: Wire, hand_over: Callable[[Sequence[CanFrame]], None], lost: Callable[[], int] = lambda: 0,
                 batch: float = 0.0, is_shared: bool = False):
        super().__init__(wire)
        self.now = time.monotonic()
        self._hand_over = hand_over
        self._lost = lost
        self._batch = batch
        self._calls: SimpleQueue[tuple[float, Call]] = SimpleQueue()
        self._is_running = False
        self._thread = ReportedThread(self._work, 'wire')
        self._due: list[Carried] = []
        self._record = WireRecord(self.now)
        self._before = (0, 0, 0, lost(), time.process_time())  # totals at the last report
        self._host = self.join(lambda carried: self._due.append(carried), by_priority=is_shared)

    def start(self) -> None:
        self._is_running = True
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread. Frames that are still being transmitted are not delivered."""
        def end() -> None:
            self._is_running = False
        self.submit(end)
        if self._thread is not threading.current_thread():
            self._thread.join()

    def submit(self, call: Call) -> None:
        if threading.current_thread() is self._thread:
            call()
        else:
            self._calls.put((time.monotonic(), call))

    def send(self, frame: CanFrame) -> None:
        """Queue a frame from the host, which takes part in arbitration from now on."""
        self.submit(lambda: self._host.put(self.now, frame))

    def wait_until_idle(self, timeout: float) -> None:
        """Wait up to ``timeout`` [s] until all queued frames have been transmitted and delivered.

        Without a timeout, the wait might never end, because other participants may keep sending.
        """
        is_idle = threading.Event()

        def look() -> None:
            if self.wire.busy_until < math.inf:
                self.at(max(self.wire.busy_until, self.now), look)
                return
            self._flush()
            is_idle.set()
        self.submit(look)
        is_idle.wait(timeout)

    def report(self) -> WireReport:
        """Return a report for the time since the last report."""
        answer: SimpleQueue[WireReport] = SimpleQueue()
        if not self._thread.is_alive():
            return self._report()
        self.submit(lambda: answer.put(self._report()))
        return answer.get()

    def on_carried(self, carried: Carried) -> None:
        self._record.carried(carried.start, carried.end)

    def _work(self) -> None:
        while self._is_running:
            for stamp, call in self._waited():
                self.run(stamp)
                call_guarded(call)
            self.run(time.monotonic())
            self._flush()

    def _waited(self) -> list[tuple[float, Call]]:
        """Wait until a frame or a timer is due or a call has been submitted. Return the submitted calls."""
        calls, pause = [], self._pause(time.monotonic())
        try:
            calls.append(self._calls.get(timeout=pause) if pause > 0 else self._calls.get_nowait())
            while True:
                calls.append(self._calls.get_nowait())
        except Empty:
            return calls

    def _pause(self, now: float) -> float:
        """Return the time to wait for the queued frames [s], limited by the batch time, the next timer and 0.5 s."""
        due = min(max(self.wire.next_end, min(self.wire.busy_until, now + self._batch)), self.next_timer, now + 0.5)
        return due - now

    def _flush(self) -> None:
        if not self._due:
            return
        batch, self._due = self._due, []
        self._hand_over([carried.frame for carried in batch])
        now = time.monotonic()
        for carried in batch:
            self._record.handed_over(now - carried.end)

    def _report(self) -> WireReport:
        record, senders = self._record, self.wire.senders
        counts = (sum(sender.queued for sender in senders), sum(sender.skipped for sender in senders),
                  sum(sender.refused for sender in senders), self._lost(), time.process_time())
        sweeps, skipped, refused, lost, cpu = (now - before for now, before in zip(counts, self._before))
        self._record, self._before = WireRecord(self.now), counts
        return WireReport(seconds=self.now - record.begin, frames=record.frames, load=record.load(self.now),
                          peak_load=record.peak_load, sweeps=int(sweeps), skipped=int(skipped), refused=int(refused),
                          handed=record.handed, lost=int(lost), late_p50=record.late(0.5), late_p99=record.late(0.99),
                          late_max=record.late_max, cpu=cpu)
