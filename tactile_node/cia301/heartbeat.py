"""Store each node's last heartbeat and last reported state (CiA 301, NMT error control)."""

import threading
import time
from collections import defaultdict
from dataclasses import dataclass

from tactile_node.cia301.objects import HEARTBEAT, NmtState

TOGGLE = 0x80  #: bit 7, which toggles in answers to node guarding


def nmt_state(data: bytes) -> int | None:
    """Return the NMT state in a heartbeat, a boot-up message or an answer to node guarding.

    The result is None for an empty message. CiA 301 defines one byte for these frames. Some devices send more bytes, of
    which the first is the state.
    """
    return data[0] & ~TOGGLE if data else None


@dataclass
class HeardNode:
    """Heartbeats received from one node. Times are from the monotonic clock [s]."""

    state: int | None = None  #: NMT state last reported; None if no heartbeat was received
    heard: float | None = None  #: time of the last heartbeat on the monotonic clock
    boots: int = 0  #: number of boot-up messages
    heartbeats: int = 0  #: number of heartbeats, not counting boot-up messages
    guarded: int = 0  #: number of heartbeats with a toggle bit, which are answers to node guarding

    #: the last two intervals between heartbeats; a change of state adds an interval, which may be short
    intervals: tuple[float, float] | None = None


class Heartbeats:
    """Keeps the last heartbeat of each node. It is thread-safe."""

    def __init__(self) -> None:
        self._nodes: defaultdict[int, HeardNode] = defaultdict(HeardNode)
        self._changed = threading.Condition()

    def of(self, node_id: int) -> HeardNode:
        """Return the record of a node, which is updated with each heartbeat."""
        with self._changed:
            return self._nodes[node_id]

    def feed(self, can_id: int, data: bytes) -> bool:
        """Process a frame with the COB-ID 0x700 + node-ID.

        Return True for a boot-up or a new state. An empty frame is ignored.
        """
        state, now = nmt_state(data), time.monotonic()
        if state is None:
            return False
        is_boot = state == NmtState.BOOT_UP
        with self._changed:
            node = self._nodes[can_id - HEARTBEAT]
            is_news = is_boot or node.state != state
            node.intervals = None if is_boot or node.heard is None else (
                0.0 if node.intervals is None else node.intervals[1], now - node.heard)
            node.state, node.heard = state, now
            node.boots += is_boot
            node.heartbeats += not is_boot
            node.guarded += data[0] & TOGGLE == TOGGLE
            self._changed.notify_all()
        return is_news

    def forget(self) -> None:
        """Forget all states, because the bus was reopened. The counts remain."""
        with self._changed:
            for node in self._nodes.values():
                node.state = node.heard = node.intervals = None

    @property
    def nodes(self) -> list[int]:
        """Node-IDs of all nodes from which a heartbeat was received, sorted."""
        with self._changed:
            return sorted(node_id for node_id, node in self._nodes.items() if node.state is not None)

    def wait_for(self, node_id: int, state: NmtState, since: float, timeout: float) -> bool:
        """Wait at most ``timeout`` [s] until the node reports ``state`` after the time ``since``.

        Returns
        -------
        bool
            True if the node reported the state in time.
        """

        node = self.of(node_id)
        with self._changed:
            return self._changed.wait_for(lambda: node.state == state and (node.heard or 0.0) >= since, timeout)
