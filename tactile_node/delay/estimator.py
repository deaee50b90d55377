"""How long a message was held back on its way, where the sender's clock and ours are not synchronised.

For each message, arrival (our steady clock) - sent (the sender's clock) = offset of the clocks + delay. The least of
these differences within a sliding window is the offset + the least delay of the path; a message is held back by what
its own exceeds the least. The method is that of `bus/stamp_clock.py` and of NTP's clock filter (RFC 5905, 10).

What it cannot see: a delay that every message of the window has. Therefore the least counts only once it is *settled*:
not falling any more, for all that was held back in a burst at start-up would look current.
"""

from collections import deque
from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple

from tactile_node.errors import ConfigurationError, InputError

BUCKETS = 30  #: parts of the window that are forgotten as a whole


@dataclass(frozen=True)
class DelaySettings:
    """How long the least difference is remembered, and when it can be trusted."""

    window: float = 30.0     #: a slower path or a clock set back unnoticed is taken as normal after this time [s]
    settle: float = 0.5      #: for how long messages have to arrive without a fall of the least difference [s]
    tolerance: float = 0.02  #: while settling, a fall by less is jitter of the path [s]
    #: once settled, a fall by less is a message that was faster than all before: they were older by that time than they
    #: seemed, and what follows is right [s]
    error: float = 0.05
    drift: float = 1e-3      #: relative: a slower fall is the drift or the slewing of a clock
    longest_gap: float = 0.1  #: a longer silence counts towards `settle` as this long [s]

    def __post_init__(self) -> None:
        values = (self.window, self.settle, self.tolerance, self.error, self.drift, self.longest_gap)
        if not (all(0 < value < inf for value in values) and self.settle < self.window and self.drift < 1
                and self.tolerance <= self.error):
            raise ConfigurationError('delay settings', expected='numbers > 0, settle < window, tolerance <= error, '
                                     'drift < 1', got=str(self), remedy='Leave them out for the defaults.')


class Delay(NamedTuple):
    """Of one message."""

    held_back: float  #: beyond the least of the window, >= 0 [s]
    settled: bool     #: False: it may have been held back for any time


class DelayEstimator:
    """Takes the messages of one sender as they arrive; pure: time is what it is given.

    After a sender's clock was set forward, or set back by more than a message's period, or after a restart of the
    sender: not settled for `DelaySettings.settle`. Set back by less, or during a silence of that length: what arrives
    is taken to be older than it is by that step, for at most `DelaySettings.window`.

    >>> estimator = DelayEstimator()
    >>> for i in range(50):
    ...     delay = estimator.update(arrival=100 + 0.02 * i, sent=1.7e9 + 0.02 * i)
    >>> delay.settled, round(estimator.update(arrival=106.0, sent=1.7e9 + 1.0).held_back, 3)
    (True, 5.0)
    """

    def __init__(self, settings: DelaySettings = DelaySettings()):
        self._settings = settings
        self._arrival = -inf
        self._sent = -inf
        self._restart()

    def _restart(self) -> None:
        self._least: deque[tuple[int, float]] = deque()  # bucket, least difference from it on; both ascending
        self._reference = inf  # what the least difference must not fall below by more than the tolerance
        self._covered = 0.0  # time with messages since it did

    def update(self, arrival: float, sent: float) -> Delay:
        """Take a message that ``arrival`` brought [s, our steady clock], ``sent`` [s, the sender's clock].

        Where a stage adds its own delay as ``age``: sent = stamp + age. Raises InputError for a time that is not
        finite.
        """
        if not (isfinite(arrival) and isfinite(sent)):
            raise InputError('times of a message', expected='finite seconds', got=f'{arrival}, {sent}',
                             remedy='Leave out messages whose age is not known.')
        gap = arrival - self._arrival
        if not 0 <= gap <= self._settings.window or sent < self._sent - self._settings.tolerance:
            self._restart()
            gap = 0.0
        self._arrival = arrival
        self._sent = sent
        difference = arrival - sent
        self._follow(self._least_with(arrival, difference), gap)
        return Delay(difference - self._least[0][1], self._covered >= self._settings.settle)

    def _least_with(self, arrival: float, difference: float) -> float:
        """Add ``difference`` to the window and return its least."""
        length = self._settings.window / BUCKETS
        bucket = int(arrival // length)
        while self._least and self._least[-1][1] >= difference:
            self._least.pop()
        self._least.append((bucket, difference))
        while self._least[0][0] <= bucket - BUCKETS:
            self._least.popleft()
        return self._least[0][1]

    def _follow(self, least: float, gap: float) -> None:
        """Start settling again after a fall; ``gap`` [s] is the time since the message before."""
        reference = self._reference - self._settings.drift * gap
        is_settled = self._covered >= self._settings.settle
        if least < reference - (self._settings.error if is_settled else self._settings.tolerance):
            self._covered = 0.0
            self._reference = least
            return
        self._covered += min(gap, self._settings.longest_gap)
        self._reference = max(least, reference)
