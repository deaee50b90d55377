"""Recognises a stamp that runs ahead of all before it: of a false message, or of a clock that was set forward."""

import math

TOLERANCE = 1.0  #: s that a stamp may be ahead of the ones before
CONFIRMED = 3    #: messages in a row that agree: the clock was set, or the source jumped
FADING = 10.0    #: s with messages in which what earlier stamps allow fades: a clock may be set back, too
LONGEST_GAP = 0.1  #: s: a longer silence counts as this long


class StampGuard:
    """Compares stamps [s, the sender's clock] with arrivals [s, our steady clock] of the messages of one topic.

    A stamp may advance as far as the time that has passed, and TOLERANCE more. What is late is another matter: see
    DelayEstimator. A replay at another pace advances by small steps and is accepted.

    >>> guard = StampGuard()
    >>> [guard.accepts(arrival, stamp) for arrival, stamp in [(5.00, 100.00), (5.02, 3700.0), (5.04, 100.04)]]
    [True, False, True]
    """

    def __init__(self) -> None:
        self._ahead: float | None = None  # the most that a stamp was ahead of its arrival
        self._arrival = 0.0
        self._suspect = 0.0  # how far the last refused stamp was ahead
        self._refused = 0  # in a row, that agree

    def accepts(self, arrival: float, stamp: float) -> bool:
        """Whether the message is no more than TOLERANCE ahead, or the CONFIRMED-th in a row that is."""
        ahead = stamp - arrival
        passed, self._arrival = min(arrival - self._arrival, LONGEST_GAP), arrival
        if self._ahead is not None and ahead > self._ahead + TOLERANCE and not self._is_confirmed(ahead):
            return False
        self._refused = 0
        more = 0.0 if self._ahead is None else max(0.0, self._ahead - ahead)
        self._ahead = ahead + more * math.exp(-passed / FADING)
        return True

    def _is_confirmed(self, ahead: float) -> bool:
        agrees = self._refused and abs(ahead - self._suspect) <= TOLERANCE
        self._refused = self._refused + 1 if agrees else 1
        self._suspect = ahead
        return self._refused >= CONFIRMED
