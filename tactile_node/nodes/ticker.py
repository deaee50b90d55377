"""Call a function of a node periodically, without rclpy's executor."""

import logging
import time
from collections.abc import Callable

from rclpy.node import Node

from tactile_node.bus.log_throttle import LogThrottle
from tactile_node.bus.threads import Pacer
from tactile_node.ros.rosout_handler import of_node

logger = logging.getLogger(__name__)


class Ticker:
    """Calls a function periodically on a thread of its own until it is stopped.

    Before each timer callback, rclpy's executor prepares all entities of the process twice, which takes 1 ms for the
    nodes of a gripper. A ticker also runs on while the executor or the chain is blocked.

    If the function raises an exception, the ticker logs it and continues.

    Parameters
    ----------
    node : Node
        Node in whose name exceptions are logged.
    period : float
        Time between two calls [s].
    call : callable
        Function to call. Other threads of the process may run at the same time.
    """

    def __init__(self, node: Node, period: float, call: Callable[[], None]):
        self._node, self._call = node, call
        self._throttle = LogThrottle()
        self._pacer = Pacer(period, self._tick, f'{node.get_name()} ticks', on_death=lambda error: None)
        self._pacer.start()

    def stop(self) -> None:
        """Call the function no more, and wait until a running call has ended."""
        self._pacer.stop()

    def _tick(self) -> None:
        try:
            self._call()
        except Exception:
            if self._node.context.ok() and self._throttle.is_due('tick', time.monotonic()):
                logger.exception('a periodic call has failed', extra=of_node(self._node))
