"""How far the clock of another host is from ours, by two-way exchanges as in NTP.

We send at t1 and receive at t4, by our clock; the other host receives at t2 and answers at t3, by its own. Its clock is
ahead by ((t2 - t1) + (t3 - t4)) / 2, which is wrong by half of the round trip (t4 - t1) - (t3 - t2) at most, however
unequal both ways are (RFC 5905, 8). So each exchange gives an interval that holds the truth; what the last FILTER of
them have in common is the estimate. NTP's clock filter takes the exchange of the least round trip; the common part is
never wider. An exchange that has nothing in common with those before shows that the other clock was set.
"""

from collections import deque
from dataclasses import dataclass
from math import inf, isfinite, nan
from typing import NamedTuple

from tactile_node.errors import ConfigurationError, InputError

KEPT = 60  #: exchanges that the drift is estimated from
FILTER = 8  #: exchanges that the offset is estimated from, as in NTP (RFC 5905, 10)


class Exchange(NamedTuple):
    """The four times of a question and its answer [s].

    >>> exchange = Exchange(sent=10.0, received=100.3, answered=100.31, arrived=10.05)
    >>> round(exchange.offset, 3), round(exchange.bound, 3)
    (90.28, 0.02)
    """

    sent: float      #: t1, our clock
    received: float  #: t2, the other clock
    answered: float  #: t3, the other clock
    arrived: float   #: t4, our clock

    @property
    def offset(self) -> float:
        """The other clock - ours [s]."""
        return ((self.received - self.sent) + (self.answered - self.arrived)) / 2

    @property
    def bound(self) -> float:
        """What the offset is wrong by at most: half of the round trip [s]."""
        return ((self.arrived - self.sent) - (self.answered - self.received)) / 2


class ClockOffset(NamedTuple):
    """The other clock against ours; NaN: not known."""

    offset: float = nan  #: the other clock - ours [s]
    bound: float = inf   #: what it is wrong by at most, unless the other clock was set meanwhile, see ``age`` [s]
    drift: float = nan   #: by which it grows in a second, relative
    age: float = inf     #: time since the last question that was answered [s]

    def against(self, lead: float) -> 'ClockOffset':
        """Return it against a clock that is ``lead`` [s] ahead of ours."""
        return self._replace(offset=self.offset - lead)


@dataclass(frozen=True)
class OffsetSettings:
    """How much clocks may drift, and from when on an offset or a drift is known."""

    drift: float = 1e-3         #: relative: an exchange is believed the less the older it is; more is a clock set
    longest_gap: float = 10.0   #: time since the last exchange from which on the offset is not known [s]
    window: float = 120.0       #: of the exchanges that the drift is estimated from [s]
    drift_error: float = 20e-6  #: relative: a drift that may be wrong by more is not known

    def __post_init__(self) -> None:
        if not all(0 < value < inf for value in (self.drift, self.longest_gap, self.window, self.drift_error)):
            raise ConfigurationError('offset settings', expected='numbers > 0', got=str(self),
                                     remedy='Leave them out for the defaults.')


class OffsetEstimator:
    """Takes the exchanges with one other host; our clock must be steady. Pure: time is what it is given.

    >>> estimator = OffsetEstimator()
    >>> estimator.update(Exchange(10.00, 100.00, 100.00, 10.04))  # ahead by 89.96 to 90.00
    >>> estimator.update(Exchange(12.00, 102.03, 102.03, 12.04))  # 89.99 to 90.03, two seconds later
    >>> offset, bound, *_ = estimator.at(12.04)
    >>> round(offset, 3), round(bound, 3)  # in common: 89.99 to 90.00, and 1e-3 of two seconds more
    (89.996, 0.006)
    """

    def __init__(self, settings: OffsetSettings = OffsetSettings()):
        self._settings = settings
        self._least, self._most = -inf, inf  # the offset at ``_looked``
        self._looked = -inf
        self._asked = -inf
        self._samples: deque[tuple[float, float, float]] = deque(maxlen=KEPT)  # time, least and most offset
        self._drift = nan
        self.jumps = 0  #: times that the other clock was set

    def update(self, exchange: Exchange) -> None:
        """Take an exchange, in the order of its ``arrived``. Raises InputError for times that cannot be."""
        if not all(map(isfinite, exchange)) or not exchange.received <= exchange.answered or exchange.bound < 0:
            raise InputError('times of an exchange', expected='finite seconds, the answer after the question',
                             got=str(tuple(exchange)), remedy='Leave it out.')
        now, bound = exchange.arrived, exchange.bound + self._settings.drift * (exchange.arrived - exchange.sent)
        self._samples.append((now, exchange.offset - bound, exchange.offset + bound))
        self._looked, self._asked = now, exchange.sent
        self._intersect()
        while now - self._samples[0][0] > self._settings.window:
            self._samples.popleft()
        self._drift = self._estimated_drift()

    def _intersect(self) -> None:
        """Find what the newest exchanges have in common; forget all before the clock was set."""
        _, least, most = self._samples[-1]
        for number in range(len(self._samples) - 2, max(-1, len(self._samples) - FILTER - 1), -1):
            at, low, high = self._samples[number]
            grown = self._settings.drift * (self._looked - at)
            if max(least, low - grown) > min(most, high + grown):
                self.jumps += 1
                for _ in range(number + 1):
                    self._samples.popleft()
                break
            least, most = max(least, low - grown), min(most, high + grown)
        self._least, self._most = least, most

    def at(self, now: float) -> ClockOffset:
        """Return the offset at ``now`` [s, our clock]."""
        if now - self._looked > self._settings.longest_gap:
            return ClockOffset()
        grown = self._settings.drift * max(0.0, now - self._looked)
        return ClockOffset((self._least + self._most) / 2, (self._most - self._least) / 2 + grown, self._drift,
                           now - self._asked)

    def _estimated_drift(self) -> float:
        """The rates that lead through all intervals, where they differ by little: a pair of exchanges bounds each."""
        least, most = -inf, inf
        samples = list(self._samples)
        for number, (begin, lowest, highest) in enumerate(samples):
            for end, low, high in samples[number + 1:]:
                if end > begin:
                    least = max(least, (low - highest) / (end - begin))
                    most = min(most, (high - lowest) / (end - begin))
        return (least + most) / 2 if 0 <= most - least <= 2 * self._settings.drift_error else nan
