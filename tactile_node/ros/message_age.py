"""`age` of the messages of the chain: the time since the acquisition, summed over the stages on steady clocks.

Each stage adds how long the message was held back on its way (`delay/estimator.py`) and the time that it took itself.
It needs no synchronised clocks. How a node uses it, with one `InputAge` for each subscription:

    self._input = InputAge(lossless=settings.lossless)        # in __init__

    def _on_taxels(self, message):
        arrival = self._input.arrived(message)                # first: what follows is the stage's own time
        ...
        result.header = message.header                        # stamp and age belong together: never stamp again
        result.age = age_message(arrival.age(time.monotonic()))  # last, before it is published
        self._publisher.publish(result)

A node that is blocked reads its queue late: `arrived` is called late too, so the time in the queue is part of what
was held back. The time stamps of DDS are not used: they are of the wall clock, and of the last sender only.

An age is *not known* (`math.inf`, in a message the longest Duration) until the least delay is settled, about 0.5 s
after each stage has received its first messages. Stages settle one after another, for no stage can measure by an age
that is not known. Compared with any limit it is too old.
"""

import math
import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

from builtin_interfaces.msg import Duration
from std_msgs.msg import Header

from tactile_node.delay.estimator import DelayEstimator
from tactile_node.ros.time_messages import duration_message, seconds

NOT_KNOWN_SEC = 2**31 - 1  #: `sec` of an age that is not known: 68 years, beyond every limit


class AgedMessage(Protocol):
    """A message of the chain."""

    header: Header
    age: Duration


class Arrival(NamedTuple):
    """When a message arrived and how old it was then."""

    steady: float          #: of our steady clock [s]
    age_on_arrival: float  #: [s]; inf: not known

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
