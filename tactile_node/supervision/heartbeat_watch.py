"""Watches how often the heartbeat of one node is received. Times are of the monotonic clock [s]."""

from collections import deque
from typing import NamedTuple

MARGIN = 1.25  # of a producer's clock, and of the time it takes between two heartbeats
LOOKS = 10  # in one window


class _Look(NamedTuple):
    at: float
    heartbeats: int
    guarded: int


class HeartbeatWatch:
    """Whether more heartbeats of one node-ID are received than one producer sends in its heartbeat time."""

    def __init__(self) -> None:
        self._looks: deque[_Look] = deque()

    def restart(self) -> None:
        """Compare with nothing of before."""
        self._looks.clear()

    def is_doubled(self, now: float, heartbeats: int, guarded: int, period: float, delay: float) -> bool:
        """Whether there are two producers, by the ``heartbeats`` received so far from a ``period`` [s] each.

        ``guarded``: those with a toggle bit; while these come, another master guards the node, which answers it.
        ``delay`` [s]: an adapter may have held back what it hands over now.
        """
        looks, window = self._looks, 3 * (delay + 2 * period)
        if not looks or now - looks[-1].at >= window / LOOKS:
            looks.append(_Look(now, heartbeats, guarded))
        while len(looks) > 1 and now - looks[1].at >= window:
            looks.popleft()
        first = looks[0]
        expected = MARGIN * (now - first.at + delay) / period + 2
        return now - first.at >= window and guarded == first.guarded and heartbeats - first.heartbeats > expected
