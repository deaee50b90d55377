"""What a simulated wire has carried, and whether its sender kept time."""

import math
from typing import NamedTuple

WINDOW = 0.1     #: s, of which the busiest is reported
STEP = 1e-5      #: s, resolution of the percentiles of lateness


class WireReport(NamedTuple):
    """Of the time since the report before."""

    seconds: float     #: of the wire
    frames: int        #: carried, of all participants
    load: float        #: share of the time in which the wire was busy
    peak_load: float   #: of the busiest WINDOW
    sweeps: int        #: that the devices have queued
    skipped: int       #: sweeps that devices left out because too many were queued
    refused: int       #: frames for which a queue had no room
    handed: int        #: frames handed over to the host
    lost: int          #: of these, that the host has not read
    late_p50: float    #: from a frame's end on the wire until it was handed over [s]
    late_p99: float
    late_max: float
    cpu: float         #: processor time of the sender [s]

    def text(self) -> str:
        """Three lines for a user."""
        return (f'wire: {self.frames} frames in {self.seconds:.1f} s, load {self.load:.1%}, '
                f'at most {self.peak_load:.1%} of {WINDOW:g} s\n'
                f'devices: {self.sweeps} sweeps, {self.skipped} skipped; frames refused by a full queue: '
                f'{self.refused}; not read by the host: {self.lost} of {self.handed}\n'
                f'sender: late by {self.late_p50 * 1e3:.2f} ms (median), {self.late_p99 * 1e3:.2f} ms (99 %), '
                f'{self.late_max * 1e3:.2f} ms at most; {self.cpu / max(self.seconds, 1e-9):.0%} of a core')


class WireRecord:
    """Counts busy time and lateness as the frames come."""

    def __init__(self, begin: float):
        self.begin = begin
        self.frames = self.handed = 0
        self.busy = 0.0
        self.late_max = 0.0
        self._late: dict[int, int] = {}
        self._window_end, self._window_busy, self._peak = begin + WINDOW, 0.0, 0.0

    def carried(self, start: float, end: float) -> None:
        """The wire was busy from ``start`` to ``end`` [s]."""
        self.frames += 1
        start = max(start, self.begin)
        self.busy += end - start
        if end > self._window_end:
            self._window_busy += max(self._window_end - start, 0.0)
            self._peak = max(self._peak, self._window_busy / WINDOW)
            self._window_end += WINDOW * math.ceil((end - self._window_end) / WINDOW)
            start, self._window_busy = max(start, self._window_end - WINDOW), 0.0
        self._window_busy += end - start

    def handed_over(self, late: float) -> None:
        """A frame was handed to the host so long after its end [s]."""
        self.handed += 1
        step = int(late / STEP)
        self._late[step] = self._late.get(step, 0) + 1
        if late > self.late_max:
            self.late_max = late

    def load(self, now: float) -> float:
        return min(self.busy / (now - self.begin), 1.0) if now > self.begin else 0.0

    @property
    def peak_load(self) -> float:
        return max(self._peak, self._window_busy / WINDOW)

    def late(self, share: float) -> float:
        """The lateness that ``share`` of the frames do not exceed [s], rounded up to STEP."""
        seen = 0
        for step in sorted(self._late):
            seen += self._late[step]
            if seen >= share * self.handed:
                return min((step + 1) * STEP, self.late_max)
        return 0.0
