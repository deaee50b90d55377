"""Measure the field `age` of the chain's messages: the time since acquisition, summed over all stages.

Each stage measures with its own steady clock, and adds the time for which a message was held back and the time for its
own processing. The stamp of a message stays the stamp of the taxels. The clocks of the hosts need not be synchronised.
`InputAge` records when each message of a subscription arrives. Results that are handed over within one process carry
their acquisition time.

A blocked node reads its queue late, and therefore also calls `arrived` late. The time that a message spends in the
queue therefore counts as time held back. The time stamps of DDS are not used, because they come from the wall clock and
cover only the last sender.

An age is *not known* (`math.inf`, in a message the longest Duration) until the smallest delay has settled. The smallest
delay of a stage settles about 0.5 s after its first messages. The stages settle one after another, because no stage can
measure a delay while the age of its input is not known. An unknown age exceeds every limit.
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

#: Time for which the smallest difference is kept [s]. Afterwards, a slower path or a changed clock counts as normal.
WINDOW = 30.0
BUCKETS = 30  #: number of parts into which WINDOW is divided; each part expires as a whole

#: Time for which messages must arrive without a decrease of the smallest difference before that difference counts as
#: settled [s].
SETTLING_TIME = 0.5
SETTLING_TOLERANCE = 0.02  #: largest decrease that counts as jitter of the path while settling [s]

#: After settling, a decrease of at most this size is attributed to a message that was faster than all earlier messages
#: [s]. By this decrease, the earlier messages were older than measured; later messages are measured correctly.
SETTLED_ERROR = 0.05
DRIFT = 1e-3  #: relative rate below which a decrease is attributed to a clock that drifts or is slewed
LONGEST_GAP = 0.1  #: longest gap between messages that counts towards SETTLING_TIME [s]


class DelayEstimator:
    """Estimates how long each message from one sender was held back. All times are arguments, so no clock is read.

    The estimate is unknown for SETTLING_TIME after the sender restarts, after its clock is set forward, or after its
    clock is set back by more than the message period. If the clock is set back by less, or during a pause of the same
    length, messages appear older by the size of the step for at most WINDOW.

    Examples
    --------
    >>> estimator = DelayEstimator()
    >>> for i in range(50):
    ...     held_back = estimator.update(arrival=100 + 0.02 * i, sent=1.7e9 + 0.02 * i)
    >>> round(held_back, 3), round(estimator.update(arrival=106.0, sent=1.7e9 + 1.0), 3)
    (0.0, 5.0)
    """

    def __init__(self) -> None:
        self._arrival = -inf
        self._sent = -inf
        self._restart()

    def _restart(self) -> None:
        # pairs of a bucket and the smallest difference since that bucket, both ascending
        self._least: deque[tuple[int, float]] = deque()
        self._reference = inf  # value with which the next smallest difference is compared
        self._covered = 0.0  # time covered by messages since the last decrease that restarted settling

    def update(self, arrival: float, sent: float) -> float:
        """Process one message, and return its delay in excess of the smallest delay in WINDOW [s].

        The result is inf while the message may have been held back for an unknown time.

        Parameters
        ----------
        arrival
            Arrival time, on this host's steady clock [s], finite.
        sent
            Sending time, on the sender's clock [s], finite. For a message with an ``age``, the sending time is stamp +
            age.
        """
        gap = arrival - self._arrival
        if not 0 <= gap <= WINDOW or sent < self._sent - SETTLING_TOLERANCE:
            self._restart()
            gap = 0.0
        self._arrival = arrival
        self._sent = sent
        difference = arrival - sent
        self._follow(self._least_with(arrival, difference), gap)
        return difference - self._least[0][1] if self._covered >= SETTLING_TIME else inf

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
        """Restart settling if the smallest difference has decreased. ``gap`` is the time since the last message [s]."""
        reference = self._reference - DRIFT * gap
        is_settled = self._covered >= SETTLING_TIME
        if least < reference - (SETTLED_ERROR if is_settled else SETTLING_TOLERANCE):
            self._covered = 0.0
            self._reference = least
            return
        self._covered += min(gap, LONGEST_GAP)
        self._reference = max(least, reference)


class MeasurementTime:
    """Determines when the data in each message of one sender was measured.

    The sender publishes a measurement immediately or not at all, and may repeat it.

    Parameters
    ----------
    use_stamps
        False to use the arrival time as the time of measurement. Use False for replays and for simulated time, which
        runs at its own speed.
    """

    def __init__(self, *, use_stamps: bool = True):
        self._delays = DelayEstimator() if use_stamps else None
        self._stamp = 0.0
        self._measured = -math.inf

    def of(self, stamp: float, arrival: float) -> float:
        """Return the time of measurement on the steady clock [s], or -inf if the time is not known yet.

        Parameters
        ----------
        stamp
            Stamp of the measurement, on the sender's clock [s]; 0 for a message without a stamp. A repeated stamp means
            a repeated measurement.
        arrival
            Arrival time, on this host's steady clock [s].
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
        return arrival - self._delays.update(arrival, stamp)


def use_stamps(node: Node, settings: NodeSettings) -> bool:
    """Return True if stamps advance at the pace of the steady clock, unlike in a simulation or a lossless replay."""
    return not (settings.lossless or node.get_parameter('use_sim_time').value)


NOT_KNOWN_SEC = 2**31 - 1  #: `sec` of an unknown age, which is 68 years and above every limit


class AgedMessage(Protocol):
    """Interface that every message of the processing chain provides."""

    header: Header
    age: Duration


class Arrival(NamedTuple):
    """Arrival time of a message, and its age on arrival."""

    steady: float          #: arrival time on this host's steady clock [s]
    age_on_arrival: float  #: age of the message on arrival [s]; inf if not known

    @property
    def acquired(self) -> float:
        """Acquisition time of the taxels on the steady clock [s]; -inf if not known."""
        return self.steady - self.age_on_arrival

    def age(self, now: float) -> float:
        """Return the age of the message at the time ``now`` on the steady clock [s]; inf if not known."""
        return self.age_on_arrival + now - self.steady


class InputAge:
    """Measures the ages of the messages of one subscription.

    Parameters
    ----------
    lossless
        True for a lossless replay, in which no message counts as held back.
    steady
        Steady clock [s].
    """

    def __init__(self, *, lossless: bool = False, steady: Callable[[], float] = time.monotonic):
        self._lossless = lossless
        self._steady = steady
        self._delays = DelayEstimator()

    def arrived(self, message: AgedMessage) -> Arrival:
        """Record that ``message`` arrives now. Call this method once per message, before any other processing."""
        now = self._steady()
        age = age_seconds(message.age)
        if self._lossless or not math.isfinite(age):
            return Arrival(now, age)
        held_back = self._delays.update(now, seconds(message.header.stamp) + age)
        return Arrival(now, age + held_back)


def age_message(age: float) -> Duration:
    """Convert an age in seconds to Duration. An age of inf becomes the longest Duration."""
    return duration_message(age) if age < NOT_KNOWN_SEC else Duration(sec=NOT_KNOWN_SEC)


def age_since(acquired: float) -> Duration:
    """Return the present age of taxels that were acquired at ``acquired`` on the steady clock [s]."""
    return age_message(time.monotonic() - acquired)


def age_seconds(age: Duration) -> float:
    """Convert an age from Duration to seconds. An unknown age becomes inf."""
    return math.inf if age.sec >= NOT_KNOWN_SEC else seconds(age)
