"""Count outages, and space the attempts to end them. Times are from the monotonic clock [s]."""

from typing import Generic

from tactile_node.assembly.health import Cause, NodeFault, Outages

LAST_RETRY = 0.5  #: longest pause between attempts [s], so that the end of a cause is noticed soon


class OutageClock(Generic[Cause]):
    """Counts the outages of a bus or a node, and adds up their time."""

    def __init__(self) -> None:
        self._count = 0
        self._seconds = 0.0  # duration of the outages that have ended
        self._begun: float | None = None
        self.cause: Cause | None = None  #: cause with which the last outage began
        self.current: Cause | None = None  #: present cause of the ongoing outage

    @property
    def is_running(self) -> bool:
        return self._begun is not None

    def begin(self, now: float, cause: Cause) -> None:
        """Begin an outage, or note a new cause of the ongoing outage."""
        if self._begun is None:
            self._begun = now
            self._count += 1
            self.cause = cause
        self.current = cause

    def end(self, now: float) -> float:
        """End the ongoing outage, if there is one; return how long it lasted [s]."""
        lasted = self.running_for(now)
        self._begun = None
        self.current = None
        self._seconds += lasted
        return lasted

    def outages(self, now: float) -> Outages[Cause]:
        return Outages(self._count, self._seconds + self.running_for(now), self.cause, self.current)

    def running_for(self, now: float) -> float:
        """Return how long the ongoing outage has lasted [s], or 0 if there is none."""
        begun = self._begun  # read once, because another thread may end the outage
        return 0.0 if begun is None else now - begun


class Backoff:
    """Decides when to try again: at once, after 0.1 s, then after twice the last pause, up to a longest pause.

    >>> backoff, now = Backoff(), 0.0
    >>> for pause in (0.1, 0.2, 0.4, 0.5, 0.5):
    ...     backoff.attempted(now)
    ...     assert not backoff.is_due(now + 0.99 * pause) and backoff.is_due(now + 1.01 * pause)
    ...     now += 10
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Try again at once, because the cause may have ended."""
        self._due = 0.0
        self._pause = 0.1

    def is_due(self, now: float) -> bool:
        return now >= self._due

    def attempted(self, now: float, longest: float = LAST_RETRY) -> None:
        self._due = now + min(self._pause, longest)
        self._pause = min(2 * self._pause, longest)


SETTLING_TIME = 10.0  #: time without a fault after which a fault of RECURRING counts as a new one [s]
#: faults whose recovery disturbs a working part of the node or the bus, and may not help
RECURRING = (NodeFault.RECONFIGURED, NodeFault.TPDO_MISSING, NodeFault.NO_HEARTBEAT)


class Attempts(Backoff):
    """Decides when to attend to a node's fault: at once if it is new, then at growing intervals.

    If a fault of RECURRING returns soon after an attempt, it counts as the same fault: two masters may write to one
    object in turn.

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
        self.count = 0  #: number of attempts to end this fault

    def fault_is(self, fault: NodeFault) -> None:
        """Note the present fault."""
        if fault is not self._fault:
            self._fault = fault
            self.count = 0
            self.reset()

    def made(self, now: float) -> None:
        """Note an attempt to end the fault."""
        self._last = now
        self.count += 1
        # An attempt for a fault of RECURRING costs the node's taxels or time on the bus, and has not helped so far.
        self.attempted(now, 30.0 if self._fault in RECURRING else LAST_RETRY)

    def has_ended(self, now: float) -> bool:
        """Return True if the fault is over and the next one counts as new. Call it while there is no fault."""
        if self._fault in RECURRING and now - self._last < SETTLING_TIME:
            return False
        self._fault = NodeFault.NONE
        self.reset()
        return True
