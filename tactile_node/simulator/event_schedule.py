"""When a simulated device sends its TPDOs without SYNC. A pure state machine; times in seconds of one clock."""

from collections.abc import Callable, Sequence

from tactile_node.simulator.tpdo_records import ConfiguredTpdo

SCAN = 0.005  # s between two looks at the taxels for what has changed


class EventSchedule:
    """Of the ``tpdos`` that have an event timer, from ``now`` on; others are never due.

    Type 254: all that have the same event timer are due together, one scan after another. Type 255: each when its
    bytes have changed, not sooner than its inhibit time after it was sent, and at the latest after its event timer.
    """

    def __init__(self, tpdos: Sequence[ConfiguredTpdo], now: float):
        self._tpdos = [tpdo for tpdo in tpdos if tpdo.event_timer]
        self._due = {tpdo.can_id: now for tpdo in self._tpdos}
        self._sent: dict[int, tuple[float, bytes]] = {}  # when and what, by COB-ID

    def due(self, now: float, data: Callable[[ConfiguredTpdo], bytes]) -> list[ConfiguredTpdo]:
        """Those to send now, in order; ``data``: what each would send."""
        return [tpdo for tpdo in self._tpdos
                if (self._is_changed(tpdo, now, data(tpdo)) if tpdo.is_on_change else self._is_timed(tpdo, now))]

    def next(self, now: float) -> float:
        """When something may be due again."""
        scans = [now + SCAN for tpdo in self._tpdos if tpdo.is_on_change]
        return min([*scans, *(self._due[tpdo.can_id] for tpdo in self._tpdos if not tpdo.is_on_change)],
                   default=now + SCAN)

    def _is_timed(self, tpdo: ConfiguredTpdo, now: float) -> bool:
        if now < self._due[tpdo.can_id]:
            return False
        self._due[tpdo.can_id] = now + tpdo.event_timer  # CiA 301: the timer begins again with each transmission
        return True

    def _is_changed(self, tpdo: ConfiguredTpdo, now: float, data: bytes) -> bool:
        sent_at, sent = self._sent.get(tpdo.can_id, (-float('inf'), b''))
        wait = tpdo.event_timer if data == sent else tpdo.inhibit_time
        if now - sent_at < wait:
            return False
        self._sent[tpdo.can_id] = now, data
        return True
