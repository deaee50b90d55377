"""Watches SYNC as it is received: a second producer, or another period. Times are of the monotonic clock [s]."""

from tactile_node.frames.health import SyncFault, SyncState

HOLD = 1.0  # s for which a foreign SYNC stays reported
WINDOW, SYNCS = 1.0, 20  # s and SYNCs over which a period is measured, at least
TOLERANCE = 0.2  # of the period; a window of SYNCS is right to 5 %


class SyncWatch:
    """Own SYNCs are not received. Where this driver produces SYNC each one received is another producer's; else their
    period is measured, and is wrong where two windows agree: the first may begin before the producer does.
    """

    def __init__(self, produce_sync: bool, period: float):
        self._produce_sync = produce_sync
        self._period = period
        self._received = 0
        self._foreign_at: float | None = None
        self._begun: tuple[float, int] | None = None  # of the window: when, SYNCs until then
        self._was_other = False
        self.state = SyncState()

    def update(self, now: float, is_active: bool, received: int) -> SyncState:
        """Return the state by the count of SYNCs ``received`` so far."""
        new, self._received = received - self._received, received
        if not is_active:
            self._begun, self._was_other = None, False
            self.state = self.state._replace(fault=SyncFault.NOT_KNOWN)
        elif self._produce_sync:
            self._count(now, new)
        else:
            self._measure(now, received)
        return self.state

    def _count(self, now: float, new: int) -> None:
        if new:
            self._foreign_at = now
        is_foreign = self._foreign_at is not None and now - self._foreign_at <= HOLD
        self.state = SyncState(SyncFault.SECOND_PRODUCER if is_foreign else SyncFault.NONE, self.state.foreign + new)

    def _measure(self, now: float, received: int) -> None:
        begun, before = self._begun = self._begun or (now, received)
        if now - begun < max(WINDOW, SYNCS * self._period):
            return
        self._begun = (now, received)
        if received == before:
            self._was_other = False
            return  # the nodes report that it is missing
        period = (now - begun) / (received - before)
        is_other = abs(period - self._period) > TOLERANCE * self._period
        fault = SyncFault.OTHER_PERIOD if is_other and self._was_other else SyncFault.NONE
        self.state, self._was_other = SyncState(fault, period=period), is_other
