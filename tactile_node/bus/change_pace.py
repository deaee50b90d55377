"""Limit how often a state is published."""

from collections import deque
from collections.abc import Hashable

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
