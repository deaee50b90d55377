"""Counts outages and spaces the attempts to end one. Times are of the monotonic clock [s]."""

from typing import Generic

from tactile_node.assembly.health import Cause, NodeFault, Outages

LAST_RETRY = 0.5  # s; it bounds how long a cause that has ended may go unnoticed


class OutageClock(Generic[Cause]):
    """The outages of a bus or a pad, one after another."""

    def __init__(self) -> None:
        self._count = 0
        self._seconds = 0.0  # lost in those that have ended
        self._begun: float | None = None
        self.cause: Cause | None = None  #: what began the last one
        self.current: Cause | None = None  #: why the one under way lasts

    @property
    def is_running(self) -> bool:
        return self._begun is not None

    def begin(self, now: float, cause: Cause) -> None:
        """Begin an outage, or continue the one under way for another cause."""
        if self._begun is None:
            self._begun = now
            self._count += 1
            self.cause = cause
        self.current = cause

    def end(self, now: float) -> float:
        """End the one under way, if any; how long it lasted [s]."""
        lasted = self.running_for(now)
        self._begun = None
        self.current = None
        self._seconds += lasted
        return lasted

    def outages(self, now: float) -> Outages[Cause]:
        return Outages(self._count, self._seconds + self.running_for(now), self.cause, self.current)

    def running_for(self, now: float) -> float:
        """How long the one under way has lasted [s], 0 when there is none."""
        begun = self._begun  # once: another thread may end it
        return 0.0 if begun is None else now - begun


class Backoff:
    """When to try again: at once, after 0.1 s, then each time twice as long, up to a longest pause.

    >>> backoff, now = Backoff(), 0.0
    >>> for pause in (0.1, 0.2, 0.4, 0.5, 0.5):
    ...     backoff.attempted(now)
    ...     assert not backoff.is_due(now + 0.99 * pause) and backoff.is_due(now + 1.01 * pause)
    ...     now += 10
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """The cause may have ended: try at once."""
        self._due = 0.0
        self._pause = 0.1

    def is_due(self, now: float) -> bool:
        return now >= self._due

    def attempted(self, now: float, longest: float = LAST_RETRY) -> None:
        self._due = now + min(self._pause, longest)
        self._pause = min(2 * self._pause, longest)


SETTLING_TIME = 10.0  # s without a fault after which one of RECURRING is a new one
#: Faults whose recovery costs a healthy part of the node or of the bus something, and may not help
RECURRING = (NodeFault.RECONFIGURED, NodeFault.TPDO_MISSING, NodeFault.NO_HEARTBEAT)


class Attempts(Backoff):
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
        super().__init__()
        self._fault = NodeFault.NONE
        self._last = -SETTLING_TIME
        self.count = 0  #: to end this fault

    def fault_is(self, fault: NodeFault) -> None:
        """This is the fault now."""
        if fault is not self._fault:
            self._fault = fault
            self.count = 0
            self.reset()

    def made(self, now: float) -> None:
        """It was tried to end the fault."""
        self._last = now
        self.count += 1
        # trying to end one of RECURRING costs the node's taxels or the bus's time, and has not helped so far
        self.attempted(now, 30.0 if self._fault in RECURRING else LAST_RETRY)

    def has_ended(self, now: float) -> bool:
        """There is no fault now: whether the next one is a new one."""
        if self._fault in RECURRING and now - self._last < SETTLING_TIME:
            return False
        self._fault = NodeFault.NONE
        self.reset()
        return True
