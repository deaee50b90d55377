"""Does something on a bus at an even pace: sends SYNC (CiA 301: the SYNC producer), polls a device."""

import threading
import time
from collections.abc import Callable

from tactile_node.canbus.stoppable_thread import StoppableThread


class Pacer:
    """Calls ``act`` every ``period`` seconds on a thread of its own until stopped.

    Paced by the monotonic clock against the ideal times, so delays do not add up. When a whole period was
    missed its call is left out and counted in ``overruns``: a burst of SYNCs would tear frames.
    """

    def __init__(self, period: float, act: Callable[[], None], name: str):
        self._period, self._act = period, act
        self._thread = StoppableThread(self._run, name)
        self.overruns = 0

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._thread.stop()

    def _run(self, stopping: threading.Event) -> None:
        due = time.monotonic()
        while not stopping.wait(max(0.0, due - time.monotonic())):
            self._act()
            due += self._period
            missed = int((time.monotonic() - due) / self._period)
            if missed > 0:
                self.overruns += missed
                due += missed * self._period
