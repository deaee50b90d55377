"""Model of a CAN wire that computes the next sender and the end of its CAN frame, without threads or a clock."""

import math
from bisect import insort
from collections import deque
from collections.abc import Iterable
from operator import itemgetter
from typing import NamedTuple

from tactile_node.cia301.frame_bits import CanFrame, arbitration, worst_case_bits


class Waiting(NamedTuple):
    """A CAN frame in the queue of a sender."""

    ready: float  #: time from which the frame may be sent [s]
    priority: int
    seconds: float     #: duration of the frame [s]
    frame: CanFrame
    ends_sweep: bool


class Sender:
    """Transmit queue in the CAN controller of one participant, created by `Wire.join`.

    Parameters
    ----------
    bit
        Duration of one bit [s].
    limit
        Maximum number of frames in the queue.
    by_priority
        True to send the frame with the lowest identifier first, as for a gateway to several participants, or False to
        send the oldest frame first.
    """

    def __init__(self, bit: float, limit: int, by_priority: bool):
        self._bit = bit  # [s]
        self._limit = limit
        self._by_priority = by_priority
        self._queue: deque[Waiting] = deque()
        self.ready = math.inf  #: time from which the first frame may be sent [s]
        self.priority = 0  #: priority of the first frame
        self.backlog = 0.0  #: total duration of the queued frames [s]
        self.sweeps = 0   #: number of queued or partly sent sweeps
        self.queued = 0   #: number of sweeps queued so far
        self.skipped = 0  #: number of sweeps that were skipped
        self.refused = 0  #: number of frames rejected because the queue was full

    def __len__(self) -> int:
        return len(self._queue)

    def put(self, ready: float, frame: CanFrame, ends_sweep: bool = False) -> None:
        """Queue a frame that may be sent from the time ``ready`` [s]. A full queue rejects and counts the frame."""
        if len(self._queue) >= self._limit:
            self.refused += 1
            return
        waiting = Waiting(ready, arbitration(frame), worst_case_bits(frame) * self._bit, frame, ends_sweep)
        if self._by_priority:
            insort(self._queue, waiting, key=itemgetter(1))
        else:
            self._queue.append(waiting)
        self.backlog += waiting.seconds
        self._look()

    def put_sweep(self, ready: float, frames: Iterable[CanFrame], most: int) -> None:
        """Queue the frames of a sweep.

        If ``most`` sweeps are queued or partly sent, the new sweep is skipped and counted, and ``frames`` is not read.
        """
        sweep = list(frames) if self.sweeps < most else []
        if self.sweeps >= most or len(self._queue) + len(sweep) > self._limit:
            self.skipped += 1
            return
        for frame in sweep:
            self.put(ready, frame, frame is sweep[-1])
        self.sweeps += bool(sweep)
        self.queued += bool(sweep)

    def take(self) -> Waiting:
        waiting = self._queue.popleft()
        self.sweeps -= waiting.ends_sweep
        self.backlog -= waiting.seconds
        self._look()
        return waiting

    def clear(self) -> None:
        """Empty the queue, as after a loss of power."""
        self._queue.clear()
        self.sweeps = 0
        self._look()

    def _look(self) -> None:
        if self._queue:
            self.ready, self.priority = self._queue[0][:2]
        else:
            self.ready, self.backlog = math.inf, 0.0


class Carried(NamedTuple):
    """A CAN frame that has been transmitted on the wire."""

    start: float  #: start of the first bit [s]
    end: float    #: end of the three bits of interframe space, after which the next frame may begin [s]
    frame: CanFrame
    sender: Sender


class Wire:
    """A simulated CAN wire, shared by several senders.

    Among the first frames of all queues, the frame with the lowest identifier is transmitted next (ISO 11898-1).


    >>> wire = Wire()
    >>> one, other = wire.join(), wire.join()
    >>> one.put(0.0, CanFrame(0x300)); one.put(0.0, CanFrame(0x100)); other.put(0.00001, CanFrame(0x200))
    >>> [(hex(carried.frame.can_id), round(carried.end, 6)) for carried in iter(lambda: wire.carry(1.0), None)]
    [('0x300', 5.5e-05), ('0x100', 0.00011), ('0x200', 0.000165)]
    """

    def __init__(self, bitrate: int = 1_000_000):
        self._bit = 1 / bitrate
        self.senders: list[Sender] = []  #: senders in the order in which they joined
        self._current: Carried | None = None  # frame being transmitted, whose end has not been reported yet
        self._free = -math.inf

    def join(self, limit: int = 1 << 14, by_priority: bool = False) -> Sender:
        """Add a participant with a queue of at most ``limit`` frames, and return the queue."""
        sender = Sender(self._bit, limit, by_priority)
        self.senders.append(sender)
        return sender

    def carry(self, until: float) -> Carried | None:
        """Return the next frame if it ends by ``until`` [s], or None.

        A frame whose transmission has already begun by ``until`` is never interrupted. A frame that is queued between
        two calls takes part in arbitration as soon as it is ready.
        """
        if self._current is None and (start := self.next_start) <= until and start < math.inf:
            self._begin(start)
        if self._current is None or self._current.end > until:
            return None
        carried, self._current = self._current, None
        return carried

    @property
    def next_start(self) -> float:
        """Time at which the next transmission begins [s], or infinity if no frame is queued."""
        ready = math.inf
        for sender in self.senders:
            if sender.ready < ready:
                ready = sender.ready
        return ready if ready > self._free else self._free if ready < math.inf else math.inf

    @property
    def next_end(self) -> float:
        """Earliest time at which the next transmission can end [s], or infinity if no frame is queued."""
        shortest = 47 * self._bit
        return self._current.end if self._current is not None else self.next_start + shortest

    @property
    def busy_until(self) -> float:
        """Time at which all frames queued so far will have been sent [s], or infinity if no frame is queued."""
        start = self.next_start
        if self._current is not None:
            start = min(start, self._current.end)
        return start + sum(sender.backlog for sender in self.senders)

    def _begin(self, start: float) -> None:
        winner = None
        for sender in self.senders:
            if sender.ready <= start and (winner is None or sender.priority < winner.priority):
                winner = sender
        assert winner is not None
        waiting = winner.take()
        self._free = start + waiting.seconds
        self._current = Carried(start, self._free, waiting.frame, winner)


PEAK_WINDOW = 0.1     #: averaging interval of the peak load [s]
LATENESS_STEP = 1e-5      #: resolution of the percentiles of lateness [s]


class WireReport(NamedTuple):
    """Statistics for the time since the last report."""

    seconds: float     #: time covered by the report [s]
    frames: int        #: number of frames transmitted by all participants
    load: float        #: fraction of time for which the wire was busy
    peak_load: float   #: load in the busiest interval of length PEAK_WINDOW
    sweeps: int        #: number of sweeps that the devices queued
    skipped: int       #: number of sweeps skipped because too many sweeps were queued
    refused: int       #: number of frames rejected by a full queue
    handed: int        #: number of frames delivered to the host
    lost: int          #: number of delivered frames that the host did not read
    late_p50: float    #: median time from the end of a frame until its delivery to the host [s]
    late_p99: float    #: 99th percentile of the time from the end of a frame until its delivery [s]
    late_max: float    #: maximum time from the end of a frame until its delivery [s]
    cpu: float         #: CPU time of the simulator's process [s]

    def text(self) -> str:
        """Format the report as three lines of text."""
        return (f'wire: {self.frames} frames in {self.seconds:.1f} s, load {self.load:.1%}, '
                f'at most {self.peak_load:.1%} of {PEAK_WINDOW:g} s\n'
                f'devices: {self.sweeps} sweeps, {self.skipped} skipped; frames refused by a full queue: '
                f'{self.refused}; not read by the host: {self.lost} of {self.handed}\n'
                f'sender: late by {self.late_p50 * 1e3:.2f} ms (median), {self.late_p99 * 1e3:.2f} ms (99 %), '
                f'{self.late_max * 1e3:.2f} ms at most; {self.cpu / max(self.seconds, 1e-9):.0%} of a core')


class WireRecord:
    """Records the busy time of the wire and the lateness of deliveries."""

    def __init__(self, begin: float):
        self.begin = begin
        self.frames = self.handed = 0
        self.busy = 0.0
        self.late_max = 0.0
        self._late: dict[int, int] = {}
        self._window_end, self._window_busy, self._peak = begin + PEAK_WINDOW, 0.0, 0.0

    def carried(self, start: float, end: float) -> None:
        """Count a frame that occupied the wire from ``start`` to ``end`` [s]."""
        self.frames += 1
        start = max(start, self.begin)
        self.busy += end - start
        if end > self._window_end:
            self._window_busy += max(self._window_end - start, 0.0)
            self._peak = max(self._peak, self._window_busy / PEAK_WINDOW)
            self._window_end += PEAK_WINDOW * math.ceil((end - self._window_end) / PEAK_WINDOW)
            start, self._window_busy = max(start, self._window_end - PEAK_WINDOW), 0.0
        self._window_busy += end - start

    def handed_over(self, late: float) -> None:
        """Count a frame that was delivered to the host ``late`` [s] after the end of its transmission."""
        self.handed += 1
        step = int(late / LATENESS_STEP)
        self._late[step] = self._late.get(step, 0) + 1
        if late > self.late_max:
            self.late_max = late

    def load(self, now: float) -> float:
        return min(self.busy / (now - self.begin), 1.0) if now > self.begin else 0.0

    @property
    def peak_load(self) -> float:
        return max(self._peak, self._window_busy / PEAK_WINDOW)

    def late(self, share: float) -> float:
        """Return the quantile ``share`` of the lateness [s], rounded up to LATENESS_STEP."""
        seen = 0
        for step in sorted(self._late):
            seen += self._late[step]
            if seen >= share * self.handed:
                return min((step + 1) * LATENESS_STEP, self.late_max)
        return 0.0
