"""A wire with those who send and receive on it, in wire time: what happens follows from the time given to ``run``."""

import heapq
import itertools
import math
import threading
import time
from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue

from tactile_node.cia301.frame_bits import Frame
from tactile_node.simulator.wire import Carried, Sender, Wire, WireRecord, WireReport
from tactile_node.threads import ReportedThread, call_guarded

Receive = Callable[[Carried], None]
Call = Callable[[], None]


class Segment:
    """Hands each frame, at its end, to all participants but its sender, and makes calls at given times of the wire.

    A participant that answers at once is asked at the exact end of the frame, however late the machine is: the wire
    decides what follows only after that. Times are in seconds; not for several threads.
    """

    def __init__(self, wire: Wire):
        self.wire = wire
        self.now = -math.inf  #: the wire's time
        self._receivers: list[tuple[Sender, Receive]] = []
        self._timers: list[tuple[float, int, Call]] = []
        self._count = itertools.count()

    def join(self, receive: Receive, by_priority: bool = False) -> Sender:
        """A further participant."""
        sender = self.wire.join(by_priority=by_priority)
        self._receivers.append((sender, receive))
        return sender

    def submit(self, call: Call) -> None:
        """Make a call that puts frames or timers; a live segment makes it on its thread."""
        call()

    def at(self, when: float, call: Call) -> None:
        """Make ``call`` when the wire's time is ``when``."""
        heapq.heappush(self._timers, (when, next(self._count), call))

    def run(self, until: float) -> None:
        """Let the wire carry, and the participants answer, what ends up to ``until``."""
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
        """Called before any participant has the frame."""

    @property
    def next_timer(self) -> float:
        return self._timers[0][0] if self._timers else math.inf


class LiveSegment(Segment):
    """Runs from ``start`` to ``stop`` in a thread. Times are those of time.monotonic.

    ``hand_over`` gets the frames that the host receives, in order; ``lost()`` counts those that it has not read.
    A frame waits for those after it ``batch`` [s] at most. ``is_shared``: several hosts are behind it, each with a
    controller. ``submit``, ``send`` and ``report`` are for any thread.
    """

    def __init__(self, wire: Wire, hand_over: Callable[[Sequence[Frame]], None], lost: Callable[[], int] = lambda: 0,
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
        self._before = (0, 0, 0, lost(), time.process_time())  # what counts on, at the last report
        self._host = self.join(lambda carried: self._due.append(carried), by_priority=is_shared)

    def start(self) -> None:
        self._is_running = True
        self._thread.start()

    def stop(self) -> None:
        """What is under way is not handed over."""
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

    def send(self, frame: Frame) -> None:
        """A frame of the host, which takes part in the arbitration from now on."""
        self.submit(lambda: self._host.put(self.now, frame))

    def wait_until_idle(self, timeout: float) -> None:
        """Return when all that was put has been carried and handed over, or after ``timeout`` [s]: others may send."""
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
        """Return the report of the time since the one before."""
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
        """Wait until a frame or a timer is due, or a call has been submitted; the calls."""
        calls, pause = [], self._pause(time.monotonic())
        try:
            calls.append(self._calls.get(timeout=pause) if pause > 0 else self._calls.get_nowait())
            while True:
                calls.append(self._calls.get_nowait())
        except Empty:
            return calls

    def _pause(self, now: float) -> float:
        """Until all is carried that waits, but not much longer than until the next frame ends [s]."""
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
