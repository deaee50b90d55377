"""Watches whether two devices send as one node. Times are of the monotonic clock [s]."""

from collections.abc import Sequence

from tactile_node.supervision.heartbeat_watch import HeartbeatWatch
from tactile_node.supervision.tpdo_watch import SurplusTpdos

HOLD = 0.5  # s beyond the time in which what is left of the second device would be seen


class SenderWatch:
    """Two heartbeats in one heartbeat time, or more TPDOs of one COB-ID than SYNCs, are of two devices.

    They count as two until neither has been seen for as long as it takes to see it.
    """

    def __init__(self) -> None:
        self._heartbeats = HeartbeatWatch()
        self._tpdos = SurplusTpdos()
        self._seen: float | None = None  # when they were seen last
        self._hold = HOLD
        self.surplus: tuple[int, ...] = ()  #: places of the TPDOs that are received too often

    @property
    def are_two(self) -> bool:
        return self._seen is not None

    def see(self, now: float) -> None:
        """Both were seen in another way."""
        self._seen = now

    def restart(self, now: float) -> None:
        """The bus was opened again: what was seen before is held, but nothing is compared with it."""
        self.pause()
        self._seen = None if self._seen is None else now

    def pause(self) -> None:
        """What comes now is no measure."""
        self._heartbeats.restart()
        self.pause_tpdos()

    def pause_tpdos(self) -> None:
        """There is no SYNC now."""
        self._tpdos.restart()

    def look_at_heartbeats(self, now: float, heartbeats: int, guarded: int, period: float | None,
                           delay: float) -> None:
        """See HeartbeatWatch; ``period`` None or 0: not known, or none."""
        self._hold = HOLD + 3 * delay + 6 * (period or 0.0)
        if not period:
            self._heartbeats.restart()
        if period and self._heartbeats.is_doubled(now, heartbeats, guarded, period, delay):
            self._seen = now
        elif self._seen is not None and now - self._seen > self._hold:
            self._seen = None
            self.surplus = ()

    def look_at_tpdos(self, now: float, syncs: int, received: Sequence[int], delay: float) -> None:
        """See SurplusTpdos."""
        surplus = self._tpdos.update(now, syncs, received, delay)
        if surplus:
            self._seen, self.surplus = now, surplus
