"""What the devices say of themselves on 0x700 + node-ID (CiA 301, NMT error control)."""

import threading
import time
from enum import IntEnum

HEARTBEAT = 0x700  # + node-ID
TOGGLE = 0x80  # bit 7 toggles in answers to node guarding


class NmtState(IntEnum):
    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


class Heartbeats:
    """The last state heard of each node; thread-safe."""

    def __init__(self):
        self._heard: dict[int, tuple[int, float]] = {}
        self._changed = threading.Condition()

    def feed(self, can_id: int, data: bytes) -> None:
        """A frame on 0x700 + node-ID; an empty one says nothing."""
        if not data:
            return
        with self._changed:
            self._heard[can_id - HEARTBEAT] = (data[0] & ~TOGGLE, time.monotonic())
            self._changed.notify_all()

    def state(self, node_id: int) -> int | None:
        """The NMT state last heard, None when the node was never heard."""
        return self._heard.get(node_id, (None, 0.0))[0]

    def wait_for(self, node_id: int, state: NmtState, since: float, timeout: float) -> bool:
        """Wait until the node has said ``state`` after ``since`` [s, monotonic clock]."""
        def said() -> bool:
            heard, when = self._heard.get(node_id, (None, 0.0))
            return heard == state and when >= since
        with self._changed:
            return self._changed.wait_for(said, timeout)
