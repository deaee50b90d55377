"""How often a message is sent: one that repeats ever more rarely, a state when it changes."""

from collections import deque
from collections.abc import Hashable

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


STATE_PERIOD = 1.0  #: s, at the latest after which the state is published again (REP-107)
MOST_STATES = 20    #: published within any STATE_PERIOD
STATE_MARGIN = 0.05  #: s from a decision to its publication, at most: no reader sees more than MOST_STATES in a period
EARLY_ROUND = 0.02   #: s: a round that comes a little early is the last one before the period is over


class ChangePace:
    """Lets a state through when it has changed, MOST_STATES times in a STATE_PERIOD at most, and after each.

    A change that comes too soon is let through by a later call, unless the state has changed back.
    """

    def __init__(self) -> None:
        self._published: deque[float] = deque(maxlen=MOST_STATES)
        self._key: Hashable = None

    def is_due(self, key: Hashable, now: float) -> bool:
        """Whether to publish the state ``key`` now, and note that it is published."""
        is_over = not self._published or now - self._published[-1] >= STATE_PERIOD - EARLY_ROUND
        if key == self._key and not is_over:
            return False
        if len(self._published) == MOST_STATES and now - self._published[0] < STATE_PERIOD + STATE_MARGIN:
            return False
        self.note(key, now)
        return True

    def note(self, key: Hashable, now: float) -> None:
        """The state is published now."""
        self._published.append(now)
        self._key = key
