"""Heartbeats of the nodes (CiA 301, NMT error control): what was last received of each node."""

import threading
import time
from collections import defaultdict
from dataclasses import dataclass

from tactile_node.cia301.objects import HEARTBEAT, NmtState

TOGGLE = 0x80  # bit 7 toggles in answers to node guarding


def nmt_state(data: bytes) -> int | None:
    """Return the NMT state in a heartbeat, a boot-up message or an answer to node guarding; None if it has no byte.

    CiA 301 gives these frames one byte. Some devices send more: their first byte is the state.
    """
    return data[0] & ~TOGGLE if data else None


@dataclass
class HeardNode:
    """What was received of one node. Times are of the monotonic clock [s]."""

    state: int | None = None  #: NMT state last heard; None: never heard
    heard: float | None = None  #: when
    boots: int = 0  #: boot-up messages
    heartbeats: int = 0  #: without boot-ups
    guarded: int = 0  #: heartbeats with a toggle bit: answers to node guarding
    intervals: tuple[float, float] | None = None  #: the last two; a change of state adds one, and a short one


class Heartbeats:
    """What was last received of each node; thread-safe."""

    def __init__(self) -> None:
        self._nodes: defaultdict[int, HeardNode] = defaultdict(HeardNode)
        self._changed = threading.Condition()

    def of(self, node_id: int) -> HeardNode:
        """Return what was received of a node, now and later."""
        with self._changed:
            return self._nodes[node_id]

    def feed(self, can_id: int, data: bytes) -> bool:
        """Take a frame on 0x700 + node-ID; True for a boot-up or a new state. An empty frame is ignored."""
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
        """Forget all states, since the bus was opened again; the counts stay."""
        with self._changed:
            for node in self._nodes.values():
                node.state = node.heard = node.intervals = None

    @property
    def nodes(self) -> list[int]:
        """The nodes that were heard, in order."""
        with self._changed:
            return sorted(node_id for node_id, node in self._nodes.items() if node.state is not None)

    def wait_for(self, node_id: int, state: NmtState, since: float, timeout: float) -> bool:
        """Wait until the node has reported ``state`` after ``since``, for ``timeout`` [s] at most."""
        node = self.of(node_id)
        with self._changed:
            return self._changed.wait_for(lambda: node.state == state and (node.heard or 0.0) >= since, timeout)
