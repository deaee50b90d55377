"""How long a viewer may show markers: a skin that has become silent must not stay on the screen."""

import math
from collections import deque

SHORTEST = 0.5  #: s; a viewer that is late for a moment does not flicker
LONGEST = 30.0  #: s; three periods of the slowest SYNC
PERIODS = 3.0   #: between two messages


class MarkerLifetime:
    """From the time between the messages that are drawn.

    A viewer measures by its own clock, which in a replay with use_sim_time is that of the log, else the steady one:
    the longer of both counts. Of the last two times the shorter counts: what follows an outage is not shown as long.
    """

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None
        self._gaps: deque[float] = deque(maxlen=2)

    def after(self, steady: float, stamp: float) -> float:
        """Return the lifetime [s] of markers that are sent at ``steady`` [s] of a message of ``stamp`` [s]."""
        if self._last is not None:
            self._gaps.append(max(steady - self._last[0], stamp - self._last[1]))
        self._last = steady, stamp
        gap = min(self._gaps, default=0.0)
        return min(max(SHORTEST, PERIODS * gap), LONGEST) if math.isfinite(gap) else SHORTEST
