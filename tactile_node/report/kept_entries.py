"""Keeps some of many entries, and counts them all: the first and the last, or the longest gaps."""

import heapq
from collections import deque
from typing import Generic, TypeVar

from tactile_node.report.model import Gap

KEPT = 100  #: at each end

Entry = TypeVar('Entry')


class Ends(Generic[Entry]):
    """Bounds the memory that a device which repeats itself can take; what lies between is only counted."""

    def __init__(self) -> None:
        self._first: list[Entry] = []
        self._last: deque[Entry] = deque(maxlen=KEPT)
        self.count = 0

    def add(self, entry: Entry) -> None:
        self.count += 1
        if len(self._first) < KEPT:
            self._first.append(entry)
        else:
            self._last.append(entry)

    def kept(self) -> tuple[Entry, ...]:
        """In their order."""
        return (*self._first, *self._last)


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
