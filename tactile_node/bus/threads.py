"""Threads of a bus, each ends when it is stopped; when a pacer calls."""

import threading
import time
from collections.abc import Callable

from tactile_node.threads import OnDeath, ReportedThread


class StoppableThread:
    """Runs ``run(stopping)`` on its own ReportedThread; ``run`` returns once the event ``stopping`` is set."""

    def __init__(self, run: Callable[[threading.Event], None], name: str, on_death: OnDeath = lambda error: None):
        self._run = run
        self._name = name
        self._on_death = on_death
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin; nothing where it has begun and was not stopped."""
        if self._thread is None:
            self._stopping.clear()
            self._thread = ReportedThread(self._run, self._name, self._stopping, on_death=self._on_death)
            self._thread.start()

    def stop(self) -> None:
        """Stop it and wait for its end, except on the thread itself."""
        self._stopping.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        self._thread = None


LEAST_PAUSE = 0.95  #: periods between two calls that catch up: a bus of so much load carries all answers meanwhile


class Schedule:
    """When the next call is due, by ideal times a ``period`` apart, so that delays do not add up.

    A call that came late is followed by shorter pauses, but none below LEAST_PAUSE x period, until the ideal times are
    met again. When a whole period was missed its call is left out and counted in ``overruns``: a burst of SYNCs would
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
        self.due = max(self._ideal, at + LEAST_PAUSE * self._period)


class Pacer(StoppableThread):
    """Calls ``act`` every ``period`` seconds, as Schedule says, until stopped; ``overruns``: calls left out."""

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
