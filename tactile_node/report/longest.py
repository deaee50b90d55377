"""Keeps the longest of many gaps, and counts them all."""

import heapq

from tactile_node.report.model import Gap

KEPT_GAPS = 50


class LongestGaps:
    """``least``: shorter ones are none [s]."""

    def __init__(self, least: float):
        self._least = least
        self._kept: list[tuple[float, float]] = []  # seconds, begin
        self._last: float | None = None
        self.count = 0

    def feed(self, stamp: float) -> None:
        """Something came at ``stamp``."""
        if self._last is not None and stamp - self._last >= self._least:
            self.count += 1
            entry = stamp - self._last, self._last
            (heapq.heappush if len(self._kept) < KEPT_GAPS else heapq.heappushpop)(self._kept, entry)
        self._last = stamp if self._last is None else max(self._last, stamp)

    def gaps(self) -> tuple[Gap, ...]:
        """In their order in time."""
        return tuple(sorted(Gap(begin, seconds) for seconds, begin in self._kept))
