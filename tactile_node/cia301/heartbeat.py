"""Heartbeats of the nodes (CiA 301, NMT error control): what was last received of each node."""

import threading
import time
from collections import Counter

from tactile_node.cia301.objects import HEARTBEAT, NmtState

TOGGLE = 0x80  # bit 7 toggles in answers to node guarding


class Heartbeats:
    """What was last received of each node, and when; thread-safe. Times are of the monotonic clock [s]."""

    def __init__(self) -> None:
        self._heard: dict[int, tuple[int, float]] = {}
        self._boots: Counter[int] = Counter()
        self._counts: Counter[int] = Counter()
        self._guarded: Counter[int] = Counter()
        self._intervals: dict[int, tuple[float, float]] = {}  # the last two [s]
        self._changed = threading.Condition()

    def feed(self, can_id: int, data: bytes) -> bool:
        """Take a frame on 0x700 + node-ID; True for a boot-up or a new state. An empty frame is ignored."""
        if not data:
            return False
        node_id = can_id - HEARTBEAT
        state = data[0] & ~TOGGLE
        with self._changed:
            is_news = state == NmtState.BOOT_UP or self.state(node_id) != state
            self._boots[node_id] += state == NmtState.BOOT_UP
            now, before = time.monotonic(), self.heard(node_id)
            if state == NmtState.BOOT_UP or before is None:
                self._intervals.pop(node_id, None)
            else:
                self._intervals[node_id] = (self._intervals.get(node_id, (0.0, 0.0))[1], now - before)
            self._heard[node_id] = (state, now)
            self._counts[node_id] += state != NmtState.BOOT_UP
            self._guarded[node_id] += data[0] & TOGGLE == TOGGLE
            self._changed.notify_all()
        return is_news

    def forget(self) -> None:
        """Forget all states, since the bus was opened again; the counts of boot-ups stay."""
        with self._changed:
            self._heard.clear()
            self._intervals.clear()

    def state(self, node_id: int) -> int | None:
        """The NMT state last heard, None when the node was never heard."""
        heard = self._heard.get(node_id)
        return None if heard is None else heard[0]

    @property
    def nodes(self) -> list[int]:
        """The nodes that were heard, in order."""
        with self._changed:
            return sorted(self._heard)

    def heard(self, node_id: int) -> float | None:
        """When the node was last heard, None when it never was."""
        heard = self._heard.get(node_id)
        return None if heard is None else heard[1]

    def boots(self, node_id: int) -> int:
        """How many boot-up messages the node has sent."""
        return self._boots[node_id]

    def counts(self, node_id: int) -> tuple[int, int]:
        """How many heartbeats the node has sent, and how many of them with a toggle bit: answers to node guarding."""
        return self._counts[node_id], self._guarded[node_id]

    def interval(self, node_id: int) -> float | None:
        """Time between two of the node's last heartbeats, the longer one [s]: a change of state adds one.

        None before the second one.
        """
        return max(self._intervals[node_id]) if node_id in self._intervals else None

    def wait_for(self, node_id: int, state: NmtState, since: float, timeout: float) -> bool:
        """Wait until the node has reported ``state`` after ``since``, for ``timeout`` [s] at most."""
        def has_reported() -> bool:
            heard, when = self._heard.get(node_id, (None, 0.0))
            return heard == state and when >= since
        with self._changed:
            return self._changed.wait_for(has_reported, timeout)
