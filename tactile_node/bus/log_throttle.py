"""Limit how often a log message is repeated."""

FIRST_PAUSE = 2.0  #: Time between the first and the second message of a kind [s].
LONGEST_PAUSE = 60.0  #: Longest time between two messages of one kind [s].


class LogThrottle:
    """Allows the first message of a kind immediately, and repetitions at intervals that double each time."""

    def __init__(self) -> None:
        self._kind = ''
        self._due = 0.0
        self._pause = FIRST_PAUSE

    def is_due(self, kind: str, now: float) -> bool:
        """Return True if a message of this kind must be sent now, and record it as sent.

        Parameters
        ----------
        kind : str
            Kind of the message. A message of a new kind is always due.
        now : float
            Present time on the steady clock [s].
        """
        if kind == self._kind and now < self._due:
            return False
        self._pause = min(2 * self._pause, LONGEST_PAUSE) if kind == self._kind else FIRST_PAUSE
        self._kind = kind
        self._due = now + self._pause
        return True

    def reset(self) -> bool:
        """Forget the last message, so that the next one is due immediately. Return True if there was a message."""
        was_sent, self._kind = bool(self._kind), ''
        return was_sent
