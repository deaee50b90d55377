"""Spaces the repetitions of one log message. Times are of the monotonic clock [s]."""

FIRST_REMINDER, LAST_REMINDER = 2.0, 60.0  # s between two sentences about the same wait


class Reminder:
    """Lets a new sentence through at once, the same one again ever more rarely."""

    def __init__(self):
        self._said, self._due, self._pause = '', 0.0, FIRST_REMINDER

    def is_due(self, kind: str, now: float) -> bool:
        if kind == self._said and now < self._due:
            return False
        self._pause = min(2 * self._pause, LAST_REMINDER) if kind == self._said else FIRST_REMINDER
        self._said, self._due = kind, now + self._pause
        return True

    def reset(self) -> None:
        self._said = ''
