"""The field `age` of the chain's messages: the time since the acquisition, added up over the stages by steady clocks.

Each stage adds the time for which a message was held back on its way, and its own processing time. The stamp remains
that of the taxels. No synchronised clocks are needed. `InputAge` notes when each message of a subscription arrives.
Data that are passed on within one process carry the time of their acquisition.

A blocked node reads its queue late. `arrived` is then called late too, so the time in the queue counts as held back.
The time stamps of DDS are not used, because they use the wall clock and cover only the last sender.

An age is *not known* (`math.inf`, in a message the longest Duration) until the smallest delay is settled, about 0.5 s
after each stage has received its first messages. Stages settle one after another, because no stage can measure with an
unknown age. An unknown age is too old for every limit.
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

#: Time for which the smallest difference is kept [s]. After it, a slower path or a set clock counts as normal.
WINDOW = 30.0
BUCKETS = 30  #: number of parts of the window; each part is forgotten as a whole
#: Time for which messages must arrive, without a decrease of the smallest difference, until it is settled [s].
SETTLING_TIME = 0.5
SETTLING_TOLERANCE = 0.02  #: while settling, a smaller decrease counts as jitter of the path [s]
#: Once settled, a smaller decrease [s] comes from a message that was faster than all earlier ones. The earlier messages
#: were older than they seemed by this time; later messages are measured correctly.
SETTLED_ERROR = 0.05
DRIFT = 1e-3  #: relative rate; a slower decrease comes from a clock that drifts or is slewed
LONGEST_GAP = 0.1  #: longest silence that counts towards SETTLING_TIME [s]


class Delay(NamedTuple):
    """Delay of one message."""

    held_back: float  #: delay beyond the smallest one in the window, >= 0 [s]
    settled: bool     #: False if the message may have been held back for any time


class DelayEstimator:
    """Estimates the delay of each message from one sender. It reads no clock; all times are arguments.

    The estimate is not settled for SETTLING_TIME after the sender restarts, after its clock is set forward, or after
    its clock is set back by more than a message's period. After a smaller step back, or a step back during a silence of
    that length, messages seem older than they are by this step, for at most WINDOW.

    Examples
    --------
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
        self._least: deque[tuple[int, float]] = deque()  # (bucket, smallest difference from it on), both ascending
        self._reference = inf  # value below which the smallest difference may decrease by at most the tolerance
        self._covered = 0.0  # time with messages since the last such decrease

    def update(self, arrival: float, sent: float) -> Delay:
        """Process a message and return its delay.

        Parameters
        ----------
        arrival
            Time of arrival, on this host's steady clock [s], finite.
        sent
            Time of sending, on the sender's clock [s], finite. If a stage adds its own delay as ``age``, this is
            stamp + age.
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
        """Add ``difference`` to the window and return the smallest difference in it."""
        length = WINDOW / BUCKETS
        bucket = int(arrival // length)
        while self._least and self._least[-1][1] >= difference:
            self._least.pop()
        self._least.append((bucket, difference))
        while self._least[0][0] <= bucket - BUCKETS:
            self._least.popleft()
        return self._least[0][1]

    def _follow(self, least: float, gap: float) -> None:
        """Start settling again after a decrease; ``gap`` is the time since the last message [s]."""
        reference = self._reference - DRIFT * gap
        is_settled = self._covered >= SETTLING_TIME
        if least < reference - (SETTLED_ERROR if is_settled else SETTLING_TOLERANCE):
            self._covered = 0.0
            self._reference = least
            return
        self._covered += min(gap, LONGEST_GAP)
        self._reference = max(least, reference)


class MeasurementTime:
    """Finds the time of measurement for the messages of one sender.

    The sender publishes a measurement at once or not at all, and may repeat it.

    Parameters
    ----------
    use_stamps
        False to take the time of arrival as the time of measurement, for simulated time, which has its own speed, and
        for replays.
    """

    def __init__(self, *, use_stamps: bool = True):
        self._delays = DelayEstimator() if use_stamps else None
        self._stamp = 0.0
        self._measured = -math.inf

    def of(self, stamp: float, arrival: float) -> float:
        """Return when the message was measured, on the steady clock [s]; -inf if this is not yet known.

        Parameters
        ----------
        stamp
            Stamp of the measurement, on the sender's clock [s]; 0 for none. An equal stamp means the same measurement.
        arrival
            Time of arrival, on this host's steady clock [s].
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
    """Return True if stamps advance like the steady clock, which simulated time and fast or slow replays do not."""
    return not (settings.lossless or node.get_parameter('use_sim_time').value)


NOT_KNOWN_SEC = 2**31 - 1  #: `sec` of an unknown age: 68 years, above every limit


class AgedMessage(Protocol):
    """Interface of a message of the chain."""

    header: Header
    age: Duration


class Arrival(NamedTuple):
    """Time of arrival of a message, and its age at that time."""

    steady: float          #: time of arrival on this host's steady clock [s]
    age_on_arrival: float  #: [s]; inf if not known

    @property
    def acquired(self) -> float:
        """Acquisition time of its taxels on the same clock [s]; -inf if not known."""
        return self.steady - self.age_on_arrival

    def age(self, now: float) -> float:
        """Return the age at the time ``now`` of the same clock [s]; inf if not known."""
        return self.age_on_arrival + now - self.steady


class InputAge:
    """Measures the ages of the messages of one subscription.

    Parameters
    ----------
    lossless
        True for a replay as fast as possible, in which no message counts as held back.
    steady
        Steady clock [s].
    """

    def __init__(self, *, lossless: bool = False, steady: Callable[[], float] = time.monotonic):
        self._lossless = lossless
        self._steady = steady
        self._delays = DelayEstimator()

    def arrived(self, message: AgedMessage) -> Arrival:
        """Note that ``message`` arrives now. Call this once for each message, before any other processing."""
        now = self._steady()
        age = age_seconds(message.age)
        if self._lossless or not math.isfinite(age):
            return Arrival(now, age)
        delay = self._delays.update(now, seconds(message.header.stamp) + age)
        return Arrival(now, age + delay.held_back if delay.settled else math.inf)


def age_message(age: float) -> Duration:
    """Convert seconds to Duration; inf becomes the longest Duration."""
    return duration_message(age) if age < NOT_KNOWN_SEC else Duration(sec=NOT_KNOWN_SEC)


def age_seconds(age: Duration) -> float:
    """Convert a Duration to seconds; an unknown age becomes inf."""
    return math.inf if age.sec >= NOT_KNOWN_SEC else seconds(age)
