"""Limit how often a message is sent.

`Reminder` allows repeated log messages only at increasing intervals. `ChangePace` allows a state to be published when
it changes, and otherwise once per period.
"""

from collections import deque
from collections.abc import Hashable

FIRST_REMINDER = 2.0  #: Time between the first and the second message of a kind [s].
LAST_REMINDER = 60.0  #: Longest time between two messages of one kind [s].


class Reminder:
    """Allows the first message of a kind immediately, and repetitions at intervals that double each time."""

    def __init__(self) -> None:
        self._kind = ''
        self._due = 0.0
        self._pause = FIRST_REMINDER

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
        self._pause = min(2 * self._pause, LAST_REMINDER) if kind == self._kind else FIRST_REMINDER
        self._kind = kind
        self._due = now + self._pause
        return True

    def reset(self) -> None:
        """Forget the last message, so that the next one is due immediately."""
        self._kind = ''


STATE_PERIOD = 1.0  #: Longest time between two publications of the state [s] (see REP-107).
MOST_STATES = 20  #: Largest number of publications within any STATE_PERIOD.

#: Longest time from the decision to publish until the publication [s]. STATE_PERIOD is extended by this time, so that a
#: reader never receives more than MOST_STATES publications in a period.
STATE_MARGIN = 0.05
#: If STATE_PERIOD ends within this time [s], the state is published early, because the next call might come too late.
EARLY_ROUND = 0.02


class ChangePace:
    """Allows a state to be published when it has changed, and at least once in each STATE_PERIOD.

    At most MOST_STATES publications fall within any STATE_PERIOD. A change beyond this limit of MOST_STATES is
    published on a later call, unless the state has changed back by then.
    """

    def __init__(self) -> None:
        self._published: deque[float] = deque(maxlen=MOST_STATES)
        self._key: Hashable = None

    def is_due(self, key: Hashable, now: float) -> bool:
        """Return True if the state must be published now, and record it as published.

        Parameters
        ----------
        key : hashable
            Value by which two states are compared.
        now : float
            Present time on the steady clock [s].
        """
        is_over = not self._published or now - self._published[-1] >= STATE_PERIOD - EARLY_ROUND
        if key == self._key and not is_over:
            return False
        if len(self._published) == MOST_STATES and now - self._published[0] < STATE_PERIOD + STATE_MARGIN:
            return False
        self.note(key, now)
        return True

    def note(self, key: Hashable, now: float) -> None:
        """Record the state ``key`` as published at ``now`` [s], even if it was not due."""
        self._published.append(now)
        self._key = key
