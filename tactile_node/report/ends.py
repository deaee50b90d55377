"""Keeps the first and the last of many entries, and counts them all."""

from collections import deque
from typing import Generic, TypeVar

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
