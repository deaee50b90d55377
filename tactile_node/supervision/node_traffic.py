"""What one node has sent, as counted: TPDOs that are missing, and signs of a second device."""

from typing import NamedTuple

from tactile_node.cia301.heartbeat import Heartbeats
from tactile_node.frames.health import SentTpdo
from tactile_node.frames.losses import PadStatistics
from tactile_node.skin.pads import CanopenNode
from tactile_node.supervision.sender_watch import SenderWatch
from tactile_node.supervision.tpdo_watch import MissingTpdos

BACKLOG_TIME = 1.0  # s after a silence in which what was held back comes, faster than one device sends it


class BusSeen(NamedTuple):
    """What a bus has brought so far, beside taxels."""

    syncs: int
    foreign_syncs: int = 0  #: of other devices, while this driver produces SYNC
    is_overloaded: bool = False  #: this process is too slow: more has been sent
    ran_again: float = 0.0  #: when it did after a stall: what was sent until then may not have been read yet [s]


class NodeTraffic:
    """Used by one thread at a time; ``missing``, ``surplus`` and ``are_two`` may be read by any."""

    def __init__(self, node: CanopenNode, heartbeats: Heartbeats):
        self._node = node
        self._heartbeats = heartbeats
        self._tpdos = tuple(SentTpdo(tpdo.number, tpdo.cob_id.of(node.node_id)) for tpdo in node.layout.tpdos)
        self._missing = MissingTpdos()
        self._senders = SenderWatch()
        self._heard = 0  # heartbeats and TPDOs, by the last look
        self._heard_at = 0.0
        self._measured_from = 0.0  # what comes earlier may be a backlog
        self.missing: tuple[SentTpdo, ...] = ()  #: that bring no taxels, while others do

    @property
    def surplus(self) -> tuple[SentTpdo, ...]:
        """TPDOs that are received more often than SYNC."""
        return tuple(self._tpdos[place] for place in self._senders.surplus)

    @property
    def are_two(self) -> bool:
        """Whether two devices send as this node."""
        return self._senders.are_two

    def see_two(self, now: float) -> None:
        """Two devices have answered as this node."""
        self._senders.see(now)

    def restart(self, now: float) -> None:
        """The bus was opened again."""
        self._senders.restart(now)

    def expect(self, now: float) -> None:
        """From now on its TPDOs are expected."""
        self._missing.expect(now)

    def look(self, now: float, is_active: bool, pad: PadStatistics, bus: BusSeen, heartbeat_time: float | None,
             delay: float) -> None:
        """Take the counts so far. ``heartbeat_time`` of the device [s], if known; ``delay`` [s] is no fault yet."""
        sends = is_active and self._node.layout.needs_sync
        missing = self._missing.update(now, pad.fresh_by_tpdo[self._node.position], delay) if sends else ()
        received = pad.distinct_by_tpdo[self._node.position] if self._node.layout.needs_sync else ()
        counts = self._heartbeats.counts(self._node.node_id)
        is_measure = not bus.is_overloaded and not self._is_backlog(
            now, counts[0] + sum(received), delay + 2 * (heartbeat_time or 0.0))
        self.missing = tuple(self._tpdos[place] for place in missing) if is_measure else ()
        if not is_measure:
            self._senders.pause()
            return
        self._senders.look_at_heartbeats(now, *counts, heartbeat_time, delay)
        if sends:
            self._senders.look_at_tpdos(now, pad.syncs + bus.foreign_syncs, received, delay)
        else:
            self._senders.pause_tpdos()

    def _is_backlog(self, now: float, heard: int, silence: float) -> bool:
        """Whether what came up to ``now`` may have waited in device or adapter, after no sign for ``silence`` [s]."""
        if heard != self._heard:
            if now - self._heard_at > silence:
                self._measured_from = now + BACKLOG_TIME
            self._heard, self._heard_at = heard, now
        return now < self._measured_from
