"""A model of a CAN wire in virtual time that uses none of the package's code (ISO 11898-1).

Each frame occupies the wire for the time of its bits. Of the frames that are ready, the wire carries the frame with the
lowest COB-ID first. The nodes answer each SYNC after a delay. Each node sends its TPDOs in a fixed order, and skips a
sweep while too many sweeps are queued.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

BIT = 1e-6  #: Duration of a bit at 1 Mbit/s [s].
SYNC_ID = 0x080


def frame_seconds(size: int) -> float:
    """Return the duration of a frame with ``size`` data bytes, the most stuff bits and three bits of intermission."""
    return (47 + 8 * size + (34 + 8 * size - 1) // 4) * BIT


class Carried(NamedTuple):
    """A frame that the wire has carried."""

    offered: float  #: time at which the sender of the frame was ready to send it [s]
    end: float      #: end of the frame's last bit [s]
    can_id: int
    number: int     #: number of the SYNC, or number of the SYNC that a TPDO answers


@dataclass
class Node:
    """One node of a skin, with the ``can_ids`` and the data of its TPDOs in the order of sending."""

    can_ids: Sequence[int]
    size: int = 8
    delay: Callable[[int], float] = lambda number: 0.0003  #: time from SYNC to the first TPDO [s]
    skips: Callable[[int], bool] = lambda number: False
    most_queued: int = 2  #: largest number of sweeps that are being sent or waiting
    answered: list[int] = field(default_factory=list)
    _queue: deque[tuple[float, int, int]] = field(default_factory=deque)

    def synchronised(self, number: int, now: float) -> None:
        if self.skips(number) or len({waiting for _, _, waiting in self._queue}) >= self.most_queued:
            return
        self.answered.append(number)
        ready = max(now + self.delay(number), self._queue[-1][0] if self._queue else 0.0)
        self._queue.extend((ready, can_id, number) for can_id in self.can_ids)

    def chatter(self, times: Sequence[float]) -> None:
        """Make a frame ready at each of the given times, independently of SYNC."""
        self._queue.extend((time, self.can_ids[0], -1) for time in times)

    @property
    def head(self) -> tuple[float, int] | None:
        """Return the time at which the next frame is ready, and the COB-ID of this frame."""
        return self._queue[0][:2] if self._queue else None

    def take(self) -> tuple[float, int, int]:
        return self._queue.popleft()


def carried(syncs: Sequence[float], nodes: Sequence[Node],
            leaves_out: Callable[[float], bool] = lambda now: False) -> Iterator[Carried]:
    """Yield all frames in the order in which the wire carries them.

    ``syncs`` are the times at which the master has a SYNC ready, in ascending order [s]. The master skips a SYNC that
    is ready if ``leaves_out(now)`` returns True.
    """
    waiting, free = deque(enumerate(syncs)), 0.0
    while True:
        heads = [(*head, node) for node in nodes if (head := node.head)]
        if waiting:
            heads.append((waiting[0][1], SYNC_ID, None))
        if not heads:
            return
        start = max(free, min(ready for ready, _, _ in heads))
        _, can_id, node = min((head for head in heads if head[0] <= start), key=lambda head: head[1])
        if node is None:
            number, ready = waiting.popleft()
            if leaves_out(ready):
                continue
            free = start + frame_seconds(0)
            yield Carried(ready, free, SYNC_ID, number)
            for each in nodes:
                each.synchronised(number, free)
        else:
            ready, _, number = node.take()
            free = start + frame_seconds(node.size)
            yield Carried(ready, free, can_id, number)
