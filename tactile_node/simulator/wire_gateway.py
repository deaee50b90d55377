"""A simulated CAN wire in real time, to which the bus of a host is connected."""

import math
import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue

import can

from tactile_node.bus.batch_reader import Batch
from tactile_node.cia301.frame_bits import CanFrame
from tactile_node.simulator.segment import Call, Segment
from tactile_node.simulator.slcan_pty import SlcanPty, frame_of
from tactile_node.simulator.wire import Carried, Wire, WireRecord, WireReport
from tactile_node.threads import ReportedThread, call_guarded


class WireGateway(Segment):
    """Connects the bus of the host to a simulated wire, which runs in a thread until ``stop``.

    Each CAN frame that the host sends on ``bus`` takes part in arbitration on the wire. Each CAN frame from a device is
    delivered to the host at the end of the frame. Wire times are those of time.monotonic. Any thread may call the
    methods.

    Parameters
    ----------
    bus
        Bus of the host.
    bitrate
        Bit rate of the wire [bit/s].
    batch
        Maximum time for which a frame waits to be delivered together with later frames [s].
    on_failure
        Called with the error if the bus does not accept a frame.
    """

    def __init__(self, bus: can.BusABC, bitrate: int, batch: float, on_failure: Callable[[Exception], None]):
        super().__init__(Wire(bitrate))
        self.now = time.monotonic()
        self.to_wall_clock = time.time() - time.monotonic()  #: offset from wire times to Unix time [s]
        self._bus, self._batch, self._on_failure = bus, batch, on_failure
        self._calls: SimpleQueue[tuple[float, Call]] = SimpleQueue()
        self._is_running = True
        self._thread = ReportedThread(self._work, 'wire')
        self._due: list[Carried] = []
        self._record = WireRecord(self.now)
        self._before = (0, 0, 0, self._lost, time.process_time())  # totals at the last report
        # On any other bus, several hosts may be connected, each with its own CAN controller.
        self._host = self.join(lambda carried: self._due.append(carried), by_priority=not isinstance(bus, SlcanPty))
        self._thread.start()

    def received(self, batch: Batch) -> None:
        """Forward frames from the host to the wire, where they take part in arbitration from now on."""
        for message in batch.messages:
            if not message.is_error_frame and not message.is_fd:
                self._send(frame_of(message))

    def _send(self, frame: CanFrame) -> None:
        self.submit(lambda: self._host.put(self.now, frame))

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

    @property
    def _lost(self) -> int:
        """Number of delivered frames that the host has not read, as far as the bus counts them."""
        return getattr(self._bus, 'lost', 0)

    def _send_to_host(self, frames: list[CanFrame]) -> None:
        try:
            if isinstance(self._bus, SlcanPty):
                self._bus.send_all(frames)
            else:
                for frame in frames:
                    self._bus.send(message_of(frame))
        except (can.CanError, OSError, ValueError) as error:
            self._on_failure(error)

    def _flush(self) -> None:
        if not self._due:
            return
        batch, self._due = self._due, []
        self._send_to_host([carried.frame for carried in batch])
        now = time.monotonic()
        for carried in batch:
            self._record.handed_over(now - carried.end)

    def _report(self) -> WireReport:
        record, senders = self._record, self.wire.senders
        counts = (sum(sender.queued for sender in senders), sum(sender.skipped for sender in senders),
                  sum(sender.refused for sender in senders), self._lost, time.process_time())
        sweeps, skipped, refused, lost, cpu = (now - before for now, before in zip(counts, self._before))
        self._record, self._before = WireRecord(self.now), counts
        return WireReport(seconds=self.now - record.begin, frames=record.frames, load=record.load(self.now),
                          peak_load=record.peak_load, sweeps=int(sweeps), skipped=int(skipped), refused=int(refused),
                          handed=record.handed, lost=int(lost), late_p50=record.late(0.5), late_p99=record.late(0.99),
                          late_max=record.late_max, cpu=cpu)


def message_of(frame: CanFrame) -> can.Message:
    return can.Message(arbitration_id=frame.can_id, is_extended_id=frame.is_extended,
                       is_remote_frame=frame.is_remote, dlc=frame.dlc, data=frame.data, is_rx=False)
