"""Watches the TPDOs of one node: those that are missing, those that come too often. Times are monotonic [s]."""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

QUEUED = 3  # TPDOs of one COB-ID that may wait in a device or an adapter when a look begins
LOOKS = 10  # in one ``timeout``


class _Look(NamedTuple):
    at: float
    syncs: int
    received: tuple[int, ...]


class MissingTpdos:
    """Which TPDOs have brought nothing for ``timeout`` [s] while others have.

    >>> watch = MissingTpdos()
    >>> watch.update(0.0, (1, 1), 0.5), watch.update(0.4, (5, 1), 0.5), watch.update(0.6, (7, 1), 0.5)
    ((), (), (1,))
    """

    def __init__(self) -> None:
        self._counts: tuple[int, ...] = ()
        self._at: list[float] = []  # when each has brought something

    def expect(self, now: float) -> None:
        """From now on they are expected."""
        self._at = [now] * len(self._at)

    def update(self, now: float, counts: Sequence[int], timeout: float) -> tuple[int, ...]:
        """Return the places of those that are missing, by the ``counts`` of all so far."""
        if len(counts) != len(self._counts):
            self._at = [now] * len(counts)
        elif counts != self._counts:
            self._at = [now if count != before else at
                        for count, before, at in zip(counts, self._counts, self._at)]
        self._counts = tuple(counts)
        late = tuple(place for place, at in enumerate(self._at) if now - at > timeout)
        return late if len(late) < len(counts) else ()


class SurplusTpdos:
    """Which TPDOs are received more often than there are SYNCs: not by one device that sends each once a SYNC.

    Of the last 2 ``delay`` [s] more are received than SYNCs of the last 3 ``delay`` can have caused: an adapter may
    hand over late what it has held back for ``delay``.
    """

    def __init__(self) -> None:
        self._looks: deque[_Look] = deque()  # ascending, a ``delay`` / LOOKS apart

    def restart(self) -> None:
        """Compare with nothing of before."""
        self._looks.clear()

    def update(self, now: float, syncs: int, received: Sequence[int], delay: float) -> tuple[int, ...]:
        """Return their places, by the counts of SYNCs and of TPDOs ``received`` so far."""
        looks = self._looks
        if not looks or now - looks[-1].at >= delay / LOOKS:
            looks.append(_Look(now, syncs, tuple(received)))
        while len(looks) > 1 and now - looks[1].at >= 3 * delay:
            looks.popleft()
        then = next(look for look in looks if now - look.at <= 2 * delay or look is looks[-1])
        allowed = syncs - looks[0].syncs + QUEUED
        return tuple(place for place, (count, before) in enumerate(zip(received, then.received))
                     if count - before > allowed)
