"""Count outages, and schedule recovery attempts. Times are from the monotonic clock [s]."""

from typing import Generic

from tactile_node.assembly.health import Cause, NodeFault, Outages

LAST_RETRY = 0.5  #: maximum pause between attempts [s], short enough that recovery soon follows the end of the cause


class OutageClock(Generic[Cause]):
    """Counts the outages of a bus or a node, and their total duration."""

    def __init__(self) -> None:
        self._count = 0
        self._seconds = 0.0  # total duration of past outages
        self._begun: float | None = None
        self.cause: Cause | None = None  #: initial cause of the last outage
        self.current: Cause | None = None  #: current cause of the ongoing outage

    @property
    def is_running(self) -> bool:
        return self._begun is not None

    def begin(self, now: float, cause: Cause) -> None:
        """Start an outage, or record a new cause of the ongoing outage."""
        if self._begun is None:
            self._begun = now
            self._count += 1
            self.cause = cause
        self.current = cause

    def end(self, now: float) -> float:
        """End any ongoing outage, and return its duration [s]."""
        lasted = self.running_for(now)
        self._begun = None
        self.current = None
        self._seconds += lasted
        return lasted

    def outages(self, now: float) -> Outages[Cause]:
        return Outages(self._count, self._seconds + self.running_for(now), self.cause, self.current)

    def running_for(self, now: float) -> float:
        """Return the duration of the ongoing outage so far [s], or 0 if there is none."""
        begun = self._begun  # a copy, because another thread may end the outage
        return 0.0 if begun is None else now - begun


class Backoff:
    """Decides when to retry: immediately, after 0.1 s, then after twice the last pause, up to a maximum pause.

    >>> backoff, now = Backoff(), 0.0
    >>> for pause in (0.1, 0.2, 0.4, 0.5, 0.5):
    ...     backoff.attempted(now)
    ...     assert not backoff.is_due(now + 0.99 * pause) and backoff.is_due(now + 1.01 * pause)
    ...     now += 10
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Allow an immediate retry, because the cause may have ended."""
        self._due = 0.0
        self._pause = 0.1

    def is_due(self, now: float) -> bool:
        return now >= self._due

    def attempted(self, now: float, longest: float = LAST_RETRY) -> None:
        self._due = now + min(self._pause, longest)
        self._pause = min(2 * self._pause, longest)


#: time without a fault after which a RECURRING fault counts as new [s]
SETTLING_TIME = 10.0
#: faults for which a recovery attempt disturbs a working part of the node or the bus, and may not help
RECURRING = (NodeFault.RECONFIGURED, NodeFault.TPDO_MISSING, NodeFault.NO_HEARTBEAT)


class Attempts(Backoff):
    """Decides when to attempt recovery from a node's fault: immediately if it is new, then at growing intervals.

    A RECURRING fault that returns soon after an attempt counts as the same fault, because two masters may be
    overwriting the same object in turn.

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
        self.count = 0  #: number of recovery attempts for this fault

    def fault_is(self, fault: NodeFault) -> None:
        """Record the current fault."""
        if fault is not self._fault:
            self._fault = fault
            self.count = 0
            self.reset()

    def made(self, now: float) -> None:
        """Record an attempt to recover from the fault."""
        self._last = now
        self.count += 1
        # A recovery attempt for a RECURRING fault interrupts the node's taxels or loads the bus, and earlier attempts
        # did not help.
        self.attempted(now, 30.0 if self._fault in RECURRING else LAST_RETRY)

    def has_ended(self, now: float) -> bool:
        """Return True if the next fault would count as new. Call this method only while there is no fault."""
        if self._fault in RECURRING and now - self._last < SETTLING_TIME:
            return False
        self._fault = NodeFault.NONE
        self.reset()
        return True
