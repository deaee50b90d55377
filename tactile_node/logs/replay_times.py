"""Control the pace at which a log is played, and record when each stamp was played."""

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

logger = logging.getLogger(__name__)

LONGEST_WAIT = 10.0  #: longer gaps in a log are skipped [s]
PLAYED_RESOLUTION = 1e-3  #: stamps played within this time of each other share an entry [s]
MOST_ENTRIES = 4096      #: number of entries kept, which cover at least 4 s of playback


class RecordedPace:
    """Waits until it is time to play a message.

    The clock starts with the first message. A gap longer than LONGEST_WAIT is skipped without waiting.

    Parameters
    ----------
    pace
        1.0 for the recorded pace, 2.0 for twice as fast, or None to never wait.
    stopping
        Event that ends the wait early.
    """

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
            logger.info('The log has a gap of %.1f s, which is skipped.', ahead * self._pace)
            self._origin -= ahead
        elif ahead > 0:
            self._stopping.wait(ahead)


class PlayedTimes:
    """Records when each stamp was played, by the steady clock.

    Only the thread that plays the log may use this object. The stamps from the log [s] must never go backwards.
    """

    def __init__(self, steady: Callable[[], float] = time.monotonic):
        self._steady = steady
        # first stamp of each entry, and the time when that stamp was played
        self._entries: deque[tuple[float, float]] = deque(maxlen=MOST_ENTRIES)

    def note(self, stamp: float) -> None:
        """Record that ``stamp`` is played now."""
        now = self._steady()
        if not self._entries or now - self._entries[-1][1] >= PLAYED_RESOLUTION:
            self._entries.append((stamp, now))

    def time_of(self, stamp: float) -> float:
        """Return the time when ``stamp`` was played, on the steady clock [s], with the resolution PLAYED_RESOLUTION.

        For a stamp older than all kept entries, the result is an upper bound. Before the first entry, it is now.
        """
        played = next((at for first, at in reversed(self._entries) if first <= stamp), None)
        if played is None:
            played = self._entries[0][1] if self._entries else self._steady()
        return played


SECOND = 1_000_000_000  #: [ns]


class TimeWindow(NamedTuple):
    """Part of a recording."""

    start: float = 0.0  #: start of the part [s since the start of the recording]
    duration: float = math.inf  #: [s]

    @property
    def end(self) -> float:
        return self.start + self.duration

    def of(self, begin: int) -> tuple[int, int | None]:
        """Return the start and the end of the window [ns]; the end is None if the window extends to the end of the
        recording.

        Parameters
        ----------
        begin
            Start of the recording [ns].

        Examples
        --------

        >>> TimeWindow(1.5, 2.0).of(10**9), TimeWindow().of(10**9)
        ((2500000000, 4500000000), (1000000000, None))
        """
        until = None if math.isinf(self.end) else begin + round(self.end * SECOND)
        return begin + round(self.start * SECOND), until


WHOLE = TimeWindow()
