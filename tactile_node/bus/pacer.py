"""Make periodic calls on a thread, and schedule them."""

import threading
import time
from collections.abc import Callable

from tactile_node.threads import OnDeath, StoppableThread

#: Shortest time between two calls while they catch up [periods]. Even at this rate, the bus can carry all answers
#: between two calls.
LEAST_PAUSE = 0.95


class Schedule:
    """Computes when the next periodic call is due. Delays do not accumulate.

    The ideal times of the calls are exactly one period apart. After a late call, the pauses are shorter until the calls
    have caught up with their ideal times. No pause is shorter than LEAST_PAUSE periods. If a call is late by a whole
    period or more, the missed calls are skipped, because a burst of SYNCs would mix the sweeps.

    Parameters
    ----------
    period : float
        Time between two calls [s].
    now : float
        Time of the first call [s].

    Attributes
    ----------
    due : float
        Time of the next call [s].
    overruns : int
        Number of calls skipped.
    """

    def __init__(self, period: float, now: float):
        self._period = period
        self._ideal = now
        self.due = now
        self.overruns = 0

    def begin(self, at: float) -> None:
        """Record that the pending call begins at the time ``at`` [s], and schedule the next call."""
        missed = int((at - self._ideal) / self._period)
        self.overruns += missed
        self._ideal += (missed + 1) * self._period
        self.due = max(self._ideal, at + LEAST_PAUSE * self._period)


class Pacer(StoppableThread):
    """Thread that makes periodic calls according to `Schedule` until it is stopped.

    Parameters
    ----------
    period : float
        Time between two calls [s].
    act : callable
        Function that is called every period.
    name : str
        Name of the thread.
    on_death : callable
        Function that is called with the exception that ends the thread.

    Attributes
    ----------
    overruns : int
        Number of calls skipped since construction.
    """

    def __init__(self, period: float, act: Callable[[], None], name: str, on_death: OnDeath):
        super().__init__(self._make_calls, name, on_death)
        self._period = period
        self._act = act
        self.overruns = 0

    def _make_calls(self, stopping: threading.Event) -> None:
        before, schedule = self.overruns, Schedule(self._period, time.monotonic())
        while not stopping.wait(max(0.0, schedule.due - time.monotonic())):
            schedule.begin(time.monotonic())
            self.overruns = before + schedule.overruns
            self._act()
