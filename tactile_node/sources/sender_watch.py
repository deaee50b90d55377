"""Evaluate the message counts of one node: find missing TPDOs, and signs of a second device."""

from collections import deque
from collections.abc import Sequence

from tactile_node.assembly.facts import PadFacts
from tactile_node.assembly.health import SentTpdo, TpdoOrder
from tactile_node.cia301.heartbeat import HeardNode
from tactile_node.skin.pads import CanopenNode
from tactile_node.sources.bus_watch import BusCounts

TWO_SENDERS_HOLD = 0.5  #: additional time without a sign of the second device before it counts as gone [s]
BACKLOG_TIME = 1.0  #: time for which received frames may be a backlog after a silence [s]
MOST_PENDING = 3  #: number of TPDOs that may be pending in a device or an adapter at the start


#: Samples of message counts from the last seconds, oldest first: time [s] and counts.
Samples = deque[tuple[float, tuple[int, ...]]]


class SenderWatch:
    """Evaluates the counts of one node.

    Only one thread at a time may use this class, but any thread may read ``missing``, ``surplus`` and ``are_two``. Two
    heartbeats within one heartbeat time are a sign of two devices, as are more TPDOs with one COB-ID than SYNCs. After
    such a sign, the node counts as two devices until no further sign has occurred for longer than a detection takes.
    """

    def __init__(self, node: CanopenNode, heard: HeardNode):
        self._node = node
        self._heard = heard
        self._tpdos = tuple(SentTpdo(tpdo.number, tpdo.cob_id.of(node.node_id)) for tpdo in node.layout.tpdos)
        self._fresh: tuple[int, ...] = ()  # count of each TPDO at the last evaluation
        self._fresh_at: list[float] = []  # time when the count of each TPDO last increased
        self._heartbeats: Samples = deque()
        self._received: Samples = deque()
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

    def expect_tpdos(self, now: float) -> None:
        """Record that TPDOs are expected from now on."""
        self._fresh_at = [now] * len(self._fresh_at)

    def look(self, now: float, is_active: bool, pad: PadFacts, bus: BusCounts, heartbeat_time: float | None,
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
        missing = self._missing(now, pad.fresh_by_tpdo[self._node.position], delay) if sends else ()
        received = pad.distinct_by_tpdo[self._node.position] if self._node.layout.needs_sync else ()
        self.order = pad.orders[self._node.position] if pad.orders else None
        period = heartbeat_time or 0.0
        is_measure = not bus.is_overloaded and not self._is_backlog(
            now, self._heard.heartbeats + sum(received), delay + 2 * period)
        self.missing = self._named(missing) if is_measure else ()
        if not is_measure:
            self._forget_counts()
            return
        if self._are_heartbeats_doubled(now, period, delay):
            self._two_seen = now
        elif self._two_seen is not None and now - self._two_seen > TWO_SENDERS_HOLD + 3 * delay + 6 * period:
            self._two_seen = None
            self.surplus = ()
        if not sends:
            self._received.clear()
        elif surplus := self._surplus(now, pad.syncs + bus.foreign_syncs, received, delay):
            self._two_seen = now
            self.surplus = self._named(surplus)

    def _named(self, places: tuple[int, ...]) -> tuple[SentTpdo, ...]:
        return tuple(self._tpdos[place] for place in places)

    def _forget_counts(self) -> None:
        """Forget the earlier counts, because comparing with them would give a wrong result."""
        self._heartbeats.clear()
        self._received.clear()

    def _is_backlog(self, now: float, signs: int, silence: float) -> bool:
        """Return True if frames received now may be a backlog, because ``silence`` [s] passed without frames."""
        if signs != self._signs:
            if now - self._signs_at > silence:
                self._measured_from = now + BACKLOG_TIME  # a backlog may arrive faster than one device sends
            self._signs = signs
            self._signs_at = now
        return now < self._measured_from

    def _missing(self, now: float, counts: Sequence[int], timeout: float) -> tuple[int, ...]:
        """Return the TPDOs whose counts have not increased for ``timeout`` [s], although those of others have."""
        if len(counts) != len(self._fresh):
            self._fresh_at = [now] * len(counts)
        elif counts != self._fresh:
            self._fresh_at = [now if count != before else at
                              for count, before, at in zip(counts, self._fresh, self._fresh_at)]
        self._fresh = tuple(counts)
        late = tuple(place for place, at in enumerate(self._fresh_at) if now - at > timeout)
        return late if len(late) < len(counts) else ()

    def _surplus(self, now: float, syncs: int, received: Sequence[int], delay: float) -> tuple[int, ...]:
        """Return the TPDOs that arrive more often than SYNC. A single device sends each TPDO once per SYNC.

        An adapter may deliver CAN frames up to ``delay`` [s] late. Therefore the TPDOs received in the last 2 ``delay``
        are compared with the SYNCs of the last 3 ``delay``.
        """
        samples = self._received
        _add_sample(samples, now, (syncs, *received), delay / 10, 3 * delay)
        _, (_, *then) = next(sample for sample in samples if now - sample[0] <= 2 * delay or sample is samples[-1])
        _, (syncs_then, *_) = samples[0]
        allowed = syncs - syncs_then + MOST_PENDING
        return tuple(place for place, (count, before) in enumerate(zip(received, then)) if count - before > allowed)

    def _are_heartbeats_doubled(self, now: float, period: float, delay: float) -> bool:
        """Return True if more heartbeats arrive than one device sends, which has the heartbeat time ``period`` [s].

        A ``period`` of 0 means that the device sends no heartbeats, or that the heartbeat time is unknown. An adapter
        may have held back CAN frames for ``delay`` [s].
        """
        if not period:
            self._heartbeats.clear()
            return False
        window = 3 * (delay + 2 * period)
        heartbeats, guarded = self._heard.heartbeats, self._heard.guarded
        _add_sample(self._heartbeats, now, (heartbeats, guarded), window / 10, window)
        begun, (heartbeats_then, guarded_then) = self._heartbeats[0]
        if now - begun < window or guarded != guarded_then:
            return False  # in the second case, the node also answers node guarding by another master
        expected = 1.25 * (now - begun + delay) / period + 2  # tolerates clock errors and pauses of the producer
        return heartbeats - heartbeats_then > expected


def _add_sample(samples: Samples, now: float, counts: tuple[int, ...], pause: float, window: float) -> None:
    """Add the present counts, unless a sample is younger than ``pause`` [s]. Drop samples older than ``window`` [s]."""
    if not samples or now - samples[-1][0] >= pause:
        samples.append((now, counts))
    while len(samples) > 1 and now - samples[1][0] >= window:
        samples.popleft()
