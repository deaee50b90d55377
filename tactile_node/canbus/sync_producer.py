"""Sends SYNC at an even pace (CiA 301: the SYNC producer of the bus)."""

import threading
import time
from collections.abc import Callable


class SyncProducer:
    """Calls ``send_sync`` every ``period`` seconds on a thread of its own until stopped.

    Paced by the monotonic clock against the ideal times, so delays do not add up. When a whole period was
    missed its SYNC is skipped and counted in ``overruns``: a burst of SYNCs would tear frames.
    """

    def __init__(self, period: float, send_sync: Callable[[], None]):
        self._period, self._send_sync = period, send_sync
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self.overruns = 0

    def start(self) -> None:
        if self._thread is None:
            self._stopping.clear()
            self._thread = threading.Thread(target=self._run, name='sync', daemon=True)
            self._thread.start()

    def stop(self) -> None:
        self._stopping.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        self._thread = None

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stopping.wait(max(0.0, due - time.monotonic())):
            self._send_sync()
            due += self._period
            missed = int((time.monotonic() - due) / self._period)
            if missed > 0:
                self.overruns += missed
                due += missed * self._period
