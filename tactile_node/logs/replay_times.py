"""The pace at which a log is played, and when each of its stamps was played, by the steady clock."""

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

logger = logging.getLogger(__name__)

LONGEST_WAIT = 10.0  # s: a longer gap in a log is not waited for
PLAYED_RESOLUTION = 1e-3  #: s: what is played within it shares an entry
MOST_ENTRIES = 4096      #: entries, so at least 4 s of playing


class RecordedPace:
    """Waits until the recorded time has come, LONGEST_WAIT at most; the clock starts with the first message."""

    def __init__(self, pace: float | None, stopping: threading.Event):
        self._pace = pace
        self._stopping = stopping
        self._origin: float | None = None

    def wait_until(self, recorded: float) -> None:
        if self._pace is None:
            return
        if self._origin is None:
            self._origin = time.monotonic() - recorded / self._pace
        ahead = self._origin + recorded / self._pace - time.monotonic()
        if ahead > LONGEST_WAIT:
            logger.info('The log has a gap of %.1f s, which is not waited for.', ahead * self._pace)
            self._origin -= ahead
        elif ahead > 0:
            self._stopping.wait(ahead)


class PlayedTimes:
    """Notes stamps [s, of the log, never going back] as they are played; used by the thread that plays them."""

    def __init__(self, steady: Callable[[], float] = time.monotonic):
        self._steady = steady
        self._entries: deque[tuple[float, float]] = deque(maxlen=MOST_ENTRIES)  # first stamp, when it was played

    def note(self, stamp: float) -> None:
        """``stamp`` is played now."""
        now = self._steady()
        if not self._entries or now - self._entries[-1][1] >= PLAYED_RESOLUTION:
            self._entries.append((stamp, now))

    def age(self, stamp: float) -> float:
        """Return the time since ``stamp`` was played [s], to PLAYED_RESOLUTION; more before all entries."""
        now = self._steady()
        played = next((at for first, at in reversed(self._entries) if first <= stamp), None)
        if played is None:
            played = self._entries[0][1] if self._entries else now
        return now - played


SECOND = 1_000_000_000  # ns


class TimeWindow(NamedTuple):
    """From ``start`` [s] after the begin of the recording, for ``duration`` [s]."""

    start: float = 0.0
    duration: float = math.inf

    @property
    def end(self) -> float:
        return self.start + self.duration

    def of(self, begin: int) -> tuple[int, int | None]:
        """Return its begin and end [ns], None: the recording's, of a recording that begins at ``begin`` [ns].

        >>> TimeWindow(1.5, 2.0).of(10**9), TimeWindow().of(10**9)
        ((2500000000, 4500000000), (1000000000, None))
        """
        until = None if math.isinf(self.end) else begin + round(self.end * SECOND)
        return begin + round(self.start * SECOND), until


WHOLE = TimeWindow()
