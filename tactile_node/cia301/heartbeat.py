"""What the devices say of themselves on 0x700 + node-ID (CiA 301, NMT error control)."""

import threading
import time
from collections import Counter
from enum import IntEnum

HEARTBEAT = 0x700  # + node-ID
TOGGLE = 0x80  # bit 7 toggles in answers to node guarding


class NmtState(IntEnum):
    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


class Heartbeats:
    """What was last heard of each node, and when; thread-safe. Times are of the monotonic clock [s]."""

    def __init__(self):
        self._heard: dict[int, tuple[int, float]] = {}
        self._boots: Counter[int] = Counter()
        self._changed = threading.Condition()

    def feed(self, can_id: int, data: bytes) -> bool:
        """A frame on 0x700 + node-ID; an empty one says nothing. True when the node says something new."""
        if not data:
            return False
        node_id, state = can_id - HEARTBEAT, data[0] & ~TOGGLE
        with self._changed:
            is_news = state == NmtState.BOOT_UP or self.state(node_id) != state
            self._boots[node_id] += state == NmtState.BOOT_UP
            self._heard[node_id] = (state, time.monotonic())
            self._changed.notify_all()
        return is_news

    def forget(self) -> None:
        """The bus was opened anew: what was heard before says nothing of now."""
        with self._changed:
            self._heard.clear()

    def state(self, node_id: int) -> int | None:
        """The NMT state last heard, None when the node was never heard."""
        return self._heard.get(node_id, (None, 0.0))[0]

    def heard(self, node_id: int) -> float | None:
        """When the node was last heard, None when it never was."""
        return self._heard.get(node_id, (0, None))[1]

    def boots(self, node_id: int) -> int:
        """How many boot-up messages the node has sent."""
        return self._boots[node_id]

    def wait_for(self, node_id: int, state: NmtState, since: float, timeout: float) -> bool:
        """Wait until the node has said ``state`` after ``since``, for ``timeout`` [s] at most."""
        def said() -> bool:
            heard, when = self._heard.get(node_id, (None, 0.0))
            return heard == state and when >= since
        with self._changed:
            return self._changed.wait_for(said, timeout)


def state_name(state: int | None) -> str:
    """Name an NMT state as CiA 301 does."""
    if state is None:
        return 'never heard'
    known = state in NmtState.__members__.values()
    return NmtState(state).name.replace('_', '-') if known else f'unknown NMT state 0x{state:02X}'
