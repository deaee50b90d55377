"""What one node has sent, as counted: TPDOs that are missing, and signs of a second device."""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from tactile_node.assembly.frame_source import PadStatistics
from tactile_node.assembly.health import SentTpdo, TpdoOrder
from tactile_node.cia301.heartbeat import HeardNode
from tactile_node.skin.pads import CanopenNode

LOOKS_IN_WINDOW = 10


class CountWindow:
    """Counts as they were in the last ``window`` [s], the oldest first."""

    def __init__(self) -> None:
        self._looks: deque[tuple[float, tuple[int, ...]]] = deque()

    def restart(self) -> None:
        """Compare with nothing of before."""
        self._looks.clear()

    def look(self, now: float, counts: tuple[int, ...], pause: float, window: float) -> None:
        """Take the counts so far, with ``pause`` [s] between two looks at least."""
        if not self._looks or now - self._looks[-1][0] >= pause:
            self._looks.append((now, counts))
        while len(self._looks) > 1 and now - self._looks[1][0] >= window:
            self._looks.popleft()


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


class SurplusTpdos(CountWindow):
    """Which TPDOs are received more often than there are SYNCs: not by one device that sends each once a SYNC.

    Of the last 2 ``delay`` [s] more are received than SYNCs of the last 3 ``delay`` can have caused: an adapter may
    hand over late what it has held back for ``delay``.
    """

    def update(self, now: float, syncs: int, received: Sequence[int], delay: float) -> tuple[int, ...]:
        """Return their places, by the counts of SYNCs and of TPDOs ``received`` so far."""
        self.look(now, (syncs, *received), delay / LOOKS_IN_WINDOW, 3 * delay)
        looks = self._looks
        _, (_, *then) = next(look for look in looks if now - look[0] <= 2 * delay or look is looks[-1])
        allowed = syncs - looks[0][1][0] + 3  # that may wait in a device or an adapter when a look begins
        return tuple(place for place, (count, before) in enumerate(zip(received, then))
                     if count - before > allowed)


class HeartbeatWatch(CountWindow):
    """Whether more heartbeats of one node-ID are received than one producer sends in its heartbeat time."""

    def is_doubled(self, now: float, heartbeats: int, guarded: int, period: float, delay: float) -> bool:
        """Whether there are two producers, by the ``heartbeats`` received so far from a ``period`` [s] each.

        ``guarded``: those with a toggle bit; while these come, another master guards the node, which answers it.
        ``delay`` [s]: an adapter may have held back what it hands over now.
        """
        window = 3 * (delay + 2 * period)
        self.look(now, (heartbeats, guarded), window / LOOKS_IN_WINDOW, window)
        begun, (heartbeats_then, guarded_then) = self._looks[0]
        expected = 1.25 * (now - begun + delay) / period + 2  # a producer's clock and pauses may be so much shorter
        return now - begun >= window and guarded == guarded_then and heartbeats - heartbeats_then > expected


class BusSeen(NamedTuple):
    """What a bus has brought so far, beside taxels."""

    syncs: int
    foreign_syncs: int = 0  #: sent by other devices, while this driver produces SYNC
    is_overloaded: bool = False  #: this process is too slow: more has been sent
    ran_again: float = 0.0  #: when it did after a stall: what was sent until then may not have been read yet [s]


TWO_SENDERS_HOLD = 0.5  # s beyond the time in which what is left of the second device would be seen


class NodeTraffic:
    """Used by one thread at a time; ``missing``, ``surplus`` and ``are_two`` may be read by any.

    Two heartbeats in one heartbeat time, or more TPDOs of one COB-ID than SYNCs, are of two devices. They count as two
    until neither has been seen for as long as it takes to see it.
    """

    def __init__(self, node: CanopenNode, heard: HeardNode):
        self._node = node
        self._heard = heard
        self._tpdos = tuple(SentTpdo(tpdo.number, tpdo.cob_id.of(node.node_id)) for tpdo in node.layout.tpdos)
        self.tpdos = MissingTpdos()
        self._heartbeats = HeartbeatWatch()
        self._surplus = SurplusTpdos()
        self._two_seen: float | None = None  # when two devices were seen last
        self._signs = 0  # heartbeats and TPDOs, by the last look
        self._signs_at = 0.0
        self._measured_from = 0.0  # what comes earlier may be a backlog
        self.missing: tuple[SentTpdo, ...] = ()  #: that bring no taxels, while others do
        self.surplus: tuple[SentTpdo, ...] = ()  #: that are received more often than SYNC
        self.order: TpdoOrder | None = None  #: in which it sends, where that is not the layout's

    @property
    def are_two(self) -> bool:
        return self._two_seen is not None

    def see_two(self, now: float) -> None:
        """Two devices were seen in another way."""
        self._two_seen = now

    def restart(self, now: float) -> None:
        """The bus was opened again: what was seen before is held, but nothing is compared with it."""
        self._forget_counts()
        self._two_seen = None if self._two_seen is None else now

    def look(self, now: float, is_active: bool, pad: PadStatistics, bus: BusSeen, heartbeat_time: float | None,
             delay: float) -> None:
        """Take the counts so far. ``heartbeat_time`` of the device [s], if known; ``delay`` [s] is no fault yet."""
        sends = is_active and self._node.layout.needs_sync
        missing = self.tpdos.update(now, pad.fresh_by_tpdo[self._node.position], delay) if sends else ()
        received = pad.distinct_by_tpdo[self._node.position] if self._node.layout.needs_sync else ()
        self.order = pad.orders[self._node.position] if pad.orders else None
        counts = self._heard.heartbeats, self._heard.guarded
        is_measure = not bus.is_overloaded and not self._is_backlog(
            now, counts[0] + sum(received), delay + 2 * (heartbeat_time or 0.0))
        self.missing = self._named(missing) if is_measure else ()
        if not is_measure:
            self._forget_counts()
            return
        self._look_at_heartbeats(now, *counts, heartbeat_time or 0.0, delay)
        if not sends:
            self._surplus.restart()
        elif surplus := self._surplus.update(now, pad.syncs + bus.foreign_syncs, received, delay):
            self._two_seen, self.surplus = now, self._named(surplus)

    def _named(self, places: tuple[int, ...]) -> tuple[SentTpdo, ...]:
        return tuple(self._tpdos[place] for place in places)

    def _forget_counts(self) -> None:
        """What comes now is no measure."""
        self._heartbeats.restart()
        self._surplus.restart()

    def _look_at_heartbeats(self, now: float, heartbeats: int, guarded: int, period: float, delay: float) -> None:
        """See HeartbeatWatch; ``period`` 0: not known, or none."""
        if not period:
            self._heartbeats.restart()
        if period and self._heartbeats.is_doubled(now, heartbeats, guarded, period, delay):
            self._two_seen = now
        elif self._two_seen is not None and now - self._two_seen > TWO_SENDERS_HOLD + 3 * delay + 6 * period:
            self._two_seen = None
            self.surplus = ()

    def _is_backlog(self, now: float, signs: int, silence: float) -> bool:
        """Whether what came up to ``now`` may have waited in device or adapter, after no sign for ``silence`` [s]."""
        if signs != self._signs:
            if now - self._signs_at > silence:
                self._measured_from = now + 1.0  # until then it may come faster than one device sends it
            self._signs, self._signs_at = signs, now
        return now < self._measured_from
