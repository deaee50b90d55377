"""Plays a log at its recorded pace, or a multiple of it."""

import logging
import threading
import time

logger = logging.getLogger(__name__)

LONGEST_WAIT = 10.0  # s: a longer gap in a log is not waited for


class RecordedPace:
    """Waits until the recorded time has come, LONGEST_WAIT at most; the clock starts with the first message."""

    def __init__(self, pace: float | None, stopping: threading.Event):
        self._pace = pace
        self._stopping = stopping
        self._origin: float | None = None

    def wait_until(self, recorded: float) -> None:
        if self._pace is None:
            return
        if self._origin is None:
            self._origin = time.monotonic() - recorded / self._pace
        ahead = self._origin + recorded / self._pace - time.monotonic()
        if ahead > LONGEST_WAIT:
            logger.info('The log has a gap of %.1f s, which is not waited for.', ahead * self._pace)
            self._origin -= ahead
        elif ahead > 0:
            self._stopping.wait(ahead)
