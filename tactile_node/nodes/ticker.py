"""Call a function of a node periodically."""

import logging
import time
from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from tactile_node.bus.log_throttle import LogThrottle
from tactile_node.bus.pacer import Pacer
from tactile_node.ros.rosout_handler import of_node

logger = logging.getLogger(__name__)


class Ticker:
    """Calls a function periodically. The ticker has a thread of its own, unless it uses rclpy's executor.

    Before each timer callback, rclpy's executor prepares all entities of the process twice, which takes 1 ms for the
    nodes of a gripper. A thread also runs on while the executor or the chain is blocked. The executor calls the
    function on the steady clock. The node's own clock stands still with use_sim_time and no /clock.

    If the function raises an exception, the ticker logs it and continues. An uncaught exception would end the executor,
    and with it every node of the process.

    Parameters
    ----------
    node : Node
        Node in whose name exceptions are logged.
    period : float
        Time between two calls [s].
    call : callable
        Function to call. On a thread, other threads of the process may run at the same time.
    on_executor : bool
        True to call the function on rclpy's executor, as long as the node exists.
    """

    def __init__(self, node: Node, period: float, call: Callable[[], None], *, on_executor: bool = False):
        self._node, self._call = node, call
        self._throttle = LogThrottle()
        if on_executor:
            self._end = node.create_timer(period, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME)).cancel
        else:
            pacer = Pacer(period, self._tick, f'{node.get_name()} ticks', on_death=lambda error: None)
            pacer.start()
            self._end = pacer.stop

    def end(self) -> None:
        """Call the function no more, and wait until a running call on the thread has ended."""
        self._end()

    def _tick(self) -> None:
        try:
            self._call()
        except Exception:
            if self._node.context.ok() and self._throttle.is_due('tick', time.monotonic()):
                logger.exception('a periodic call has failed', extra=of_node(self._node))
