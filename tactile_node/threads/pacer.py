"""Does something on a bus at an even pace: sends SYNC (CiA 301: the SYNC producer), polls a device."""

import threading
import time
from collections.abc import Callable

from tactile_node.threads.stoppable_thread import StoppableThread

LEAST = 0.9  #: of a period, between two calls that catch up: what a full bus carries is still under way


class Schedule:
    """When the next call is due, by ideal times a ``period`` apart, so that delays do not add up.

    A call that came late is followed by shorter pauses, but none below LEAST x period, until the ideal times are met
    again. When a whole period was missed its call is left out and counted in ``overruns``: a burst of SYNCs would
    tear frames.
    """

    def __init__(self, period: float, now: float):
        self._period = period
        self._ideal = now
        self.due = now
        self.overruns = 0

    def begin(self, at: float) -> None:
        """The call that was due begins ``at``."""
        missed = int((at - self._ideal) / self._period)
        self.overruns += missed
        self._ideal += (missed + 1) * self._period
        self.due = max(self._ideal, at + LEAST * self._period)


class Pacer:
    """Calls ``act`` every ``period`` seconds, as Schedule says, on its own thread until stopped."""

    def __init__(self, period: float, act: Callable[[], None], name: str):
        self._period = period
        self._act = act
        self._thread = StoppableThread(self._run, name)
        self.overruns = 0

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._thread.stop()

    def _run(self, stopping: threading.Event) -> None:
        before, schedule = self.overruns, Schedule(self._period, time.monotonic())
        while not stopping.wait(max(0.0, schedule.due - time.monotonic())):
            schedule.begin(time.monotonic())
            self.overruns = before + schedule.overruns
            self._act()
