"""The timer on which nodes report their health."""

import logging
import time
from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from tactile_node.threads.reminder import Reminder

logger = logging.getLogger(__name__)

PERIOD = 1.0  # s, REP-107


def start_health_timer(node: Node, publish: Callable[[], None], period: float = PERIOD) -> None:
    """Call ``publish`` each ``period`` [s] as long as the node lasts, on the steady clock.

    With use_sim_time and no /clock the node's own clock stands still, and the last OK would stay. An exception of
    ``publish`` is logged: it would end the executor, and with it every node of the process.
    """
    reminder = Reminder()

    def report() -> None:
        try:
            publish()
        except Exception:
            if not node.context.ok():  # nothing can be published: the process ends
                raise
            if reminder.is_due('health', time.monotonic()):
                logger.exception('%s: its health cannot be reported', node.get_fully_qualified_name())
    node.create_timer(period, report, clock=Clock(clock_type=ClockType.STEADY_TIME))
