"""Does something on a bus at an even pace: sends SYNC (CiA 301: the SYNC producer), polls a device."""

import threading
import time
from collections.abc import Callable


class Pacer:
    """Calls ``act`` every ``period`` seconds on a thread of its own until stopped.

    Paced by the monotonic clock against the ideal times, so delays do not add up. When a whole period was
    missed its call is left out and counted in ``overruns``: a burst of SYNCs would tear frames.
    """

    def __init__(self, period: float, act: Callable[[], None], name: str):
        self._period, self._act, self._name = period, act, name
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self.overruns = 0

    def start(self) -> None:
        if self._thread is None:
            self._stopping.clear()
            self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
            self._thread.start()

    def stop(self) -> None:
        self._stopping.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        self._thread = None

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stopping.wait(max(0.0, due - time.monotonic())):
            self._act()
            due += self._period
            missed = int((time.monotonic() - due) / self._period)
            if missed > 0:
                self.overruns += missed
                due += missed * self._period
