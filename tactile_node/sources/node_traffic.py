"""Evaluate the message counts of one node: find missing TPDOs, and signs of a second device."""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from tactile_node.assembly.frame_source import PadStatistics
from tactile_node.assembly.health import SentTpdo, TpdoOrder
from tactile_node.cia301.heartbeat import HeardNode
from tactile_node.skin.pads import CanopenNode

LOOKS_IN_WINDOW = 10  #: number of samples per window


class CountWindow:
    """Samples of message counts from the last ``window`` [s], oldest first."""

    def __init__(self) -> None:
        self._looks: deque[tuple[float, tuple[int, ...]]] = deque()

    def restart(self) -> None:
        """Forget all samples, so that later counts are not compared with old samples."""
        self._looks.clear()

    def look(self, now: float, counts: tuple[int, ...], pause: float, window: float) -> None:
        """Add a sample of the counts, and drop samples older than the window.

        Parameters
        ----------
        now
            Present time [s].
        counts
            Counts so far.
        pause
            Minimum time between two samples [s].
        window
            Length of the window [s].
        """
        if not self._looks or now - self._looks[-1][0] >= pause:
            self._looks.append((now, counts))
        while len(self._looks) > 1 and now - self._looks[1][0] >= window:
            self._looks.popleft()


class MissingTpdos:
    """Finds the TPDOs whose counts have not increased for ``timeout`` [s], although those of other TPDOs have.

    >>> watch = MissingTpdos()
    >>> watch.update(0.0, (1, 1), 0.5), watch.update(0.4, (5, 1), 0.5), watch.update(0.6, (7, 1), 0.5)
    ((), (), (1,))
    """

    def __init__(self) -> None:
        self._counts: tuple[int, ...] = ()
        self._at: list[float] = []  # time when the count of each TPDO last increased

    def expect(self, now: float) -> None:
        """Record that TPDOs are expected from now on."""
        self._at = [now] * len(self._at)

    def update(self, now: float, counts: Sequence[int], timeout: float) -> tuple[int, ...]:
        """Return the indices of the missing TPDOs. ``counts`` has the count of each TPDO so far."""
        if len(counts) != len(self._counts):
            self._at = [now] * len(counts)
        elif counts != self._counts:
            self._at = [now if count != before else at
                        for count, before, at in zip(counts, self._counts, self._at)]
        self._counts = tuple(counts)
        late = tuple(place for place, at in enumerate(self._at) if now - at > timeout)
        return late if len(late) < len(counts) else ()


class SurplusTpdos(CountWindow):
    """Finds the TPDOs that arrive more often than SYNC. A single device sends each TPDO once per SYNC.

    An adapter may deliver CAN frames up to ``delay`` [s] late. Therefore the TPDOs received in the last 2 ``delay`` are
    compared with the SYNCs of the last 3 ``delay``.
    """

    def update(self, now: float, syncs: int, received: Sequence[int], delay: float) -> tuple[int, ...]:
        """Return the indices of the surplus TPDOs, given the numbers of SYNCs and received TPDOs so far."""
        self.look(now, (syncs, *received), delay / LOOKS_IN_WINDOW, 3 * delay)
        looks = self._looks
        _, (_, *then) = next(look for look in looks if now - look[0] <= 2 * delay or look is looks[-1])
        allowed = syncs - looks[0][1][0] + 3  # at the start, 3 TPDOs may still be pending in a device or adapter
        return tuple(place for place, (count, before) in enumerate(zip(received, then))
                     if count - before > allowed)


class HeartbeatWatch(CountWindow):
    """Detects more heartbeats from one node-ID than a single device would send."""

    def is_doubled(self, now: float, heartbeats: int, guarded: int, period: float, delay: float) -> bool:
        """Return True if two devices send heartbeats with the same node-ID.

        Parameters
        ----------
        now
            Present time [s].
        heartbeats
            Number of heartbeats received so far.
        guarded
            Number of heartbeats with a toggle bit. A rise means that the node is answering node guarding by another
            master.
        period
            Heartbeat time of the device [s].
        delay
            Maximum time for which an adapter may have held back CAN frames [s].
        """
        window = 3 * (delay + 2 * period)
        self.look(now, (heartbeats, guarded), window / LOOKS_IN_WINDOW, window)
        begun, (heartbeats_then, guarded_then) = self._looks[0]
        expected = 1.25 * (now - begun + delay) / period + 2  # margin for clock errors and pauses of the producer
        return now - begun >= window and guarded == guarded_then and heartbeats - heartbeats_then > expected


class BusSeen(NamedTuple):
    """SYNC counts of the bus so far, and the overload of this process."""

    syncs: int
    foreign_syncs: int = 0  #: number of SYNCs from other devices while this driver produces SYNC
    is_overloaded: bool = False  #: True if this process is too slow to count all messages
    ran_again: float = 0.0  #: time when this process resumed after a stall [s]; earlier messages may still be waiting


TWO_SENDERS_HOLD = 0.5  #: additional time without a sign of the second device before it counts as gone [s]


class NodeTraffic:
    """Evaluates the counts of one node.

    Only one thread at a time may use this class, but any thread may read ``missing``, ``surplus`` and ``are_two``. Two
    heartbeats within one heartbeat time are a sign of two devices, as are more TPDOs with one COB-ID than SYNCs. The
    node counts as two devices until the signs of a second device have been absent for the time needed to detect them.
    """

    def __init__(self, node: CanopenNode, heard: HeardNode):
        self._node = node
        self._heard = heard
        self._tpdos = tuple(SentTpdo(tpdo.number, tpdo.cob_id.of(node.node_id)) for tpdo in node.layout.tpdos)
        self.tpdos = MissingTpdos()
        self._heartbeats = HeartbeatWatch()
        self._surplus = SurplusTpdos()
        self._two_seen: float | None = None  # time when two devices were last seen
        self._signs = 0  # total number of heartbeats and TPDOs at the last evaluation
        self._signs_at = 0.0  # time when the number of heartbeats and TPDOs last changed
        self._measured_from = 0.0  # time before which received frames may be a backlog
        self.missing: tuple[SentTpdo, ...] = ()  #: TPDOs that deliver no taxels while other TPDOs do
        self.surplus: tuple[SentTpdo, ...] = ()  #: TPDOs that arrive more often than SYNC
        self.order: TpdoOrder | None = None  #: order in which the node sends TPDOs, or None if it matches the layout

    @property
    def are_two(self) -> bool:
        return self._two_seen is not None

    def see_two(self, now: float) -> None:
        """Record that two devices were detected in another way."""
        self._two_seen = now

    def restart(self, now: float) -> None:
        """Record that the bus was reopened. Keep the result, but do not compare with earlier counts."""
        self._forget_counts()
        self._two_seen = None if self._two_seen is None else now

    def look(self, now: float, is_active: bool, pad: PadStatistics, bus: BusSeen, heartbeat_time: float | None,
             delay: float) -> None:
        """Evaluate the counts so far.

        Parameters
        ----------
        now
            Present time [s].
        is_active
            True if the node should be OPERATIONAL.
        pad
            Counts of the pad.
        bus
            Counts of the bus.
        heartbeat_time
            Heartbeat time of the device [s], or None if unknown.
        delay
            Maximum tolerated time without data [s].
        """
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
        """Forget the earlier counts, because comparing with them would give a wrong result."""
        self._heartbeats.restart()
        self._surplus.restart()

    def _look_at_heartbeats(self, now: float, heartbeats: int, guarded: int, period: float, delay: float) -> None:
        """Look for duplicate heartbeats. ``period`` is 0 if the heartbeat time is 0 or unknown."""
        if not period:
            self._heartbeats.restart()
        if period and self._heartbeats.is_doubled(now, heartbeats, guarded, period, delay):
            self._two_seen = now
        elif self._two_seen is not None and now - self._two_seen > TWO_SENDERS_HOLD + 3 * delay + 6 * period:
            self._two_seen = None
            self.surplus = ()

    def _is_backlog(self, now: float, signs: int, silence: float) -> bool:
        """Return True if frames received now may be a backlog, because ``silence`` [s] passed without frames."""
        if signs != self._signs:
            if now - self._signs_at > silence:
                self._measured_from = now + 1.0  # a backlog may arrive faster than one device sends
            self._signs, self._signs_at = signs, now
        return now < self._measured_from
