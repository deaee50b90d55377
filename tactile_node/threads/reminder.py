"""Spaces the repetitions of one log message. Times are of the monotonic clock [s]."""

FIRST_REMINDER, LAST_REMINDER = 2.0, 60.0  # s between two messages of one kind


class Reminder:
    """Lets a message of a new kind through at once, of the same kind again ever more rarely."""

    def __init__(self) -> None:
        self._kind = ''
        self._due = 0.0
        self._pause = FIRST_REMINDER

    def is_due(self, kind: str, now: float) -> bool:
        """Whether to send the message now, and note that it is sent."""
        if kind == self._kind and now < self._due:
            return False
        self._pause = min(2 * self._pause, LAST_REMINDER) if kind == self._kind else FIRST_REMINDER
        self._kind = kind
        self._due = now + self._pause
        return True

    def reset(self) -> None:
        self._kind = ''
