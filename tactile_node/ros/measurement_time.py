"""When something was measured, on our steady clock, by messages whose stamps are of another clock."""

import math

from rclpy.node import Node

from tactile_node.delay.estimator import DelayEstimator
from tactile_node.ros.settings import NodeSettings


class MeasurementTime:
    """Of the messages of one sender, which send a measurement at once or not at all, or again and again.

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
