"""The attempts to end the faults of one node. Times are of the monotonic clock [s]."""

from tactile_node.frames.health import NodeFault
from tactile_node.supervision.outage import LAST_RETRY, RAREST_RETRY, Backoff

SETTLED = 10.0  # s without a fault after which one of RECURRING is a new one
#: Faults whose recovery costs a healthy part of the node or of the bus something, and may not help
RECURRING = (NodeFault.RECONFIGURED, NodeFault.TPDO_MISSING, NodeFault.NO_HEARTBEAT)


class Attempts:
    """A new fault is attended to at once, one that stays ever more rarely.

    One of RECURRING that returns soon after an attempt is the same: two masters may write one object in turns.

    >>> attempts = Attempts()
    >>> for now in (0.0, 1.0, 2.0):
    ...     attempts.fault_is(NodeFault.RECONFIGURED)
    ...     attempts.made(now)
    ...     assert not attempts.has_ended(now + 0.5)
    >>> attempts.is_due(2.3), attempts.is_due(2.4), attempts.has_ended(12.0)
    (False, True, True)
    """

    def __init__(self) -> None:
        self._backoff = Backoff()
        self._fault = NodeFault.NONE
        self._last = -SETTLED
        self.count = 0  #: to end this fault

    def restart(self) -> None:
        """The cause may have ended."""
        self._backoff.reset()

    def fault_is(self, fault: NodeFault) -> None:
        """This is the fault now."""
        if fault is not self._fault:
            self._fault = fault
            self.count = 0
            self._backoff.reset()

    def is_due(self, now: float) -> bool:
        return self._backoff.is_due(now)

    def made(self, now: float) -> None:
        """It was tried to end the fault."""
        self._last = now
        self.count += 1
        self._backoff.attempted(now, RAREST_RETRY if self._fault in RECURRING else LAST_RETRY)

    def has_ended(self, now: float) -> bool:
        """There is no fault now: whether the next one is a new one."""
        if self._fault in RECURRING and now - self._last < SETTLED:
            return False
        self._fault = NodeFault.NONE
        self._backoff.reset()
        return True
