"""Counts outages and spaces the attempts to end one. Times are of the monotonic clock [s]."""

from tactile_node.frames.health import Outages

FIRST_RETRY, LAST_RETRY = 0.1, 0.5  # s; the last bounds how long a cause that has ended may go unnoticed


class OutageClock:
    """The outages of a bus or a pad, one after another."""

    def __init__(self):
        self._ended, self._count, self._seconds = 0.0, 0, 0.0
        self._begun: float | None = None
        self.cause = self.reason = ''  # what began the last one, what goes on

    @property
    def is_running(self) -> bool:
        return self._begun is not None

    def begin(self, now: float, reason: str) -> None:
        """Begin an outage, or go on with the one under way."""
        if self._begun is None:
            self._begun, self._count, self.cause = now, self._count + 1, reason
        self.reason = reason

    def end(self, now: float) -> float:
        """End it; how long it lasted [s]."""
        lasted = now - self._begun
        self._begun, self._seconds = None, self._seconds + lasted
        return lasted

    def outages(self, now: float) -> Outages:
        return Outages(self._count, self._seconds + self.running_for(now), self.cause)

    def running_for(self, now: float) -> float:
        """How long the one under way has lasted [s], 0 when there is none."""
        return 0.0 if self._begun is None else now - self._begun


class Backoff:
    """When to try again: at once, after 0.1 s, then each time twice as long, up to LAST_RETRY."""

    def __init__(self):
        self.reset()

    def reset(self) -> None:
        """What has changed may have mended it: try at once."""
        self._due, self._pause = 0.0, FIRST_RETRY

    def is_due(self, now: float) -> bool:
        return now >= self._due

    def attempted(self, now: float) -> None:
        self._due, self._pause = now + self._pause, min(2 * self._pause, LAST_RETRY)
