"""Spaces the publications of a state. Times are of the monotonic clock [s]."""

from collections import deque
from collections.abc import Hashable

PERIOD = 1.0   #: s, at the latest after which the state is published again (REP-107)
MOST = 20      #: publications within any PERIOD
MARGIN = 0.05  #: s from a decision to its publication, at most: no PERIOD of any reader's sees more than MOST
EARLY = 0.02   #: s: a round that comes a little early is the last one before the period is over


class ChangePace:
    """Lets a state through when it has changed, MOST times in a PERIOD at most, and after each PERIOD.

    A change that comes too soon is let through by a later call, unless the state has changed back.
    """

    def __init__(self) -> None:
        self._published: deque[float] = deque(maxlen=MOST)
        self._key: Hashable = None

    def is_due(self, key: Hashable, now: float) -> bool:
        """Whether to publish the state ``key`` now, and note that it is published."""
        is_over = not self._published or now - self._published[-1] >= PERIOD - EARLY
        if key == self._key and not is_over:
            return False
        if len(self._published) == MOST and now - self._published[0] < PERIOD + MARGIN:
            return False
        self.note(key, now)
        return True

    def note(self, key: Hashable, now: float) -> None:
        """The state is published now."""
        self._published.append(now)
        self._key = key
