"""The timer on which nodes report their health."""

from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

PERIOD = 1.0  # s, REP-107


def start_health_timer(node: Node, publish: Callable[[], None]) -> None:
    """Call ``publish`` once a second as long as the node lasts, on the steady clock.

    With use_sim_time and no /clock the node's own clock stands still, and the last OK would stay.
    """
    node.create_timer(PERIOD, publish, clock=Clock(clock_type=ClockType.STEADY_TIME))
