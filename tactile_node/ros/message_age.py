"""`age` of the messages of the chain: the time since the acquisition, summed over the stages on steady clocks.

Each stage adds how long the message was held back on its way and the time that it took itself; the stamp stays that
of the taxels. It needs no synchronised clocks. `InputAge` notes when each message of a subscription arrives; what is
handed over in one process has the time of its acquisition itself.

A node that is blocked reads its queue late: `arrived` is called late too, so the time in the queue is part of what
was held back. The time stamps of DDS are not used: they are of the wall clock, and of the last sender only.

An age is *not known* (`math.inf`, in a message the longest Duration) until the least delay is settled, about 0.5 s
after each stage has received its first messages. Stages settle one after another, for no stage can measure by an age
that is not known. Compared with any limit it is too old.
"""

import math
import time
from collections import deque
from collections.abc import Callable
from math import inf
from typing import NamedTuple, Protocol

from builtin_interfaces.msg import Duration
from rclpy.node import Node
from std_msgs.msg import Header

from tactile_node.ros.settings import NodeSettings
from tactile_node.ros.time_messages import duration_message, seconds

WINDOW = 30.0  #: s for which the least difference is remembered: then a slower path, or a clock set back, is normal
BUCKETS = 30  #: parts of it that are forgotten as a whole
SETTLING_TIME = 0.5  #: s for which messages have to arrive without a fall of the least difference
SETTLING_TOLERANCE = 0.02  #: s; while settling, a fall by less is jitter of the path
#: s; once settled, a fall by less is a message that was faster than all before: they were older by that time than they
#: seemed, and what follows is right
SETTLED_ERROR = 0.05
DRIFT = 1e-3  #: relative: a slower fall is the drift or the slewing of a clock
LONGEST_GAP = 0.1  #: s; a longer silence counts towards SETTLING_TIME as this long


class Delay(NamedTuple):
    """Delay of one message."""

    held_back: float  #: beyond the least of the window, >= 0 [s]
    settled: bool     #: False: it may have been held back for any time


class DelayEstimator:
    """Takes the messages of one sender as they arrive; pure: time is what it is given.

    After a sender's clock was set forward, or set back by more than a message's period, or after a restart of the
    sender: not settled for SETTLING_TIME. Set back by less, or during a silence of that length: what arrives
    is taken to be older than it is by that step, for at most WINDOW.

    >>> estimator = DelayEstimator()
    >>> for i in range(50):
    ...     delay = estimator.update(arrival=100 + 0.02 * i, sent=1.7e9 + 0.02 * i)
    >>> delay.settled, round(estimator.update(arrival=106.0, sent=1.7e9 + 1.0).held_back, 3)
    (True, 5.0)
    """

    def __init__(self) -> None:
        self._arrival = -inf
        self._sent = -inf
        self._restart()

    def _restart(self) -> None:
        self._least: deque[tuple[int, float]] = deque()  # bucket, least difference from it on; both ascending
        self._reference = inf  # what the least difference must not fall below by more than the tolerance
        self._covered = 0.0  # time with messages since it did

    def update(self, arrival: float, sent: float) -> Delay:
        """Take a message that ``arrival`` brought [s, our steady clock], ``sent`` [s, the sender's clock].

        Both finite. Where a stage adds its own delay as ``age``: sent = stamp + age.
        """
        gap = arrival - self._arrival
        if not 0 <= gap <= WINDOW or sent < self._sent - SETTLING_TOLERANCE:
            self._restart()
            gap = 0.0
        self._arrival = arrival
        self._sent = sent
        difference = arrival - sent
        self._follow(self._least_with(arrival, difference), gap)
        return Delay(difference - self._least[0][1], self._covered >= SETTLING_TIME)

    def _least_with(self, arrival: float, difference: float) -> float:
        """Add ``difference`` to the window and return its least."""
        length = WINDOW / BUCKETS
        bucket = int(arrival // length)
        while self._least and self._least[-1][1] >= difference:
            self._least.pop()
        self._least.append((bucket, difference))
        while self._least[0][0] <= bucket - BUCKETS:
            self._least.popleft()
        return self._least[0][1]

    def _follow(self, least: float, gap: float) -> None:
        """Start settling again after a fall; ``gap`` [s] is the time since the message before."""
        reference = self._reference - DRIFT * gap
        is_settled = self._covered >= SETTLING_TIME
        if least < reference - (SETTLED_ERROR if is_settled else SETTLING_TOLERANCE):
            self._covered = 0.0
            self._reference = least
            return
        self._covered += min(gap, LONGEST_GAP)
        self._reference = max(least, reference)


class MeasurementTime:
    """Measurement times of one sender's messages, which send a measurement at once or not at all, or again and again.

    ``use_stamps`` False: what is received is taken to be measured then. For simulated time, which runs at its own
    speed, and replays.
    """

    def __init__(self, *, use_stamps: bool = True):
        self._delays = DelayEstimator() if use_stamps else None
        self._stamp = 0.0
        self._measured = -math.inf

    def of(self, stamp: float, arrival: float) -> float:
        """Return when the message that arrives at ``arrival`` was measured [s, steady]; -inf: not known yet.

        ``stamp``: of its measurement [s, the sender's clock]; 0: none. The same stamp again is the same measurement.
        """
        if not stamp:
            return arrival
        if stamp != self._stamp:
            self._stamp = stamp
            self._measured = self._first_sent(stamp, arrival)
        return self._measured

    def _first_sent(self, stamp: float, arrival: float) -> float:
        if self._delays is None:
            return arrival
        delay = self._delays.update(arrival, stamp)
        return arrival - delay.held_back if delay.settled else -math.inf


def use_stamps(node: Node, settings: NodeSettings) -> bool:
    """Whether stamps advance as our steady clock does: not in simulated time nor in a replay at another speed."""
    return not (settings.lossless or node.get_parameter('use_sim_time').value)


NOT_KNOWN_SEC = 2**31 - 1  #: `sec` of an age that is not known: 68 years, beyond every limit


class AgedMessage(Protocol):
    """A message of the chain."""

    header: Header
    age: Duration


class Arrival(NamedTuple):
    """When a message arrived and how old it was then."""

    steady: float          #: of our steady clock [s]
    age_on_arrival: float  #: [s]; inf: not known

    @property
    def acquired(self) -> float:
        """When its taxels were acquired [s, the same clock]; -inf when that is not known."""
        return self.steady - self.age_on_arrival

    def age(self, now: float) -> float:
        """Return its age at ``now`` [s, the same clock]; inf when it is not known."""
        return self.age_on_arrival + now - self.steady


class InputAge:
    """Ages of the messages of one subscription. ``lossless``: a replay as fast as possible, nothing is held back."""

    def __init__(self, *, lossless: bool = False, steady: Callable[[], float] = time.monotonic):
        self._lossless = lossless
        self._steady = steady
        self._delays = DelayEstimator()

    def arrived(self, message: AgedMessage) -> Arrival:
        """Note that ``message`` arrives now; call it once for each message, before anything else is done with it."""
        now = self._steady()
        age = age_seconds(message.age)
        if self._lossless or not math.isfinite(age):
            return Arrival(now, age)
        delay = self._delays.update(now, seconds(message.header.stamp) + age)
        return Arrival(now, age + delay.held_back if delay.settled else math.inf)


def age_message(age: float) -> Duration:
    """Seconds -> Duration; inf: the longest Duration."""
    return duration_message(age) if age < NOT_KNOWN_SEC else Duration(sec=NOT_KNOWN_SEC)


def age_seconds(age: Duration) -> float:
    """Duration -> seconds; inf when it is not known."""
    return math.inf if age.sec >= NOT_KNOWN_SEC else seconds(age)
