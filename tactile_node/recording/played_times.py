"""When the CAN frames of a log were played, by the steady clock."""

import time
from collections import deque
from collections.abc import Callable

RESOLUTION = 1e-3  #: s: what is played within it shares an entry
LENGTH = 4096      #: entries, so at least 4 s of playing


class PlayedTimes:
    """Notes stamps [s, of the log, never going back] as they are played; used by the thread that plays them."""

    def __init__(self, steady: Callable[[], float] = time.monotonic):
        self._steady = steady
        self._entries: deque[tuple[float, float]] = deque(maxlen=LENGTH)  # first stamp, when it was played

    def note(self, stamp: float) -> None:
        """``stamp`` is played now."""
        now = self._steady()
        if not self._entries or now - self._entries[-1][1] >= RESOLUTION:
            self._entries.append((stamp, now))

    def age(self, stamp: float) -> float:
        """Return the time since ``stamp`` was played [s], to RESOLUTION; what came before all entries is older."""
        now = self._steady()
        played = next((at for first, at in reversed(self._entries) if first <= stamp), None)
        if played is None:
            played = self._entries[0][1] if self._entries else now
        return now - played
