"""The service `~/host_time` of a driver node."""

import time
from collections.abc import Callable

from rclpy.node import Node

from tactile_node.ros.time_messages import time_message
from tactile_skin.srv import HostTime


class HostTimeService:
    """Answers with the wall clock of this host, at once; ``stamps_ahead()``: of the frames [s].

    It lasts as long as its node: without a bus a clock can be compared, too.
    """

    def __init__(self, node: Node, stamps_ahead: Callable[[], float]):
        self._stamps_ahead = stamps_ahead
        node.create_service(HostTime, '~/host_time', self._answer)

    def _answer(self, _request: HostTime.Request, response: HostTime.Response) -> HostTime.Response:
        response.received = time_message(time.time())
        response.stamps_ahead = self._stamps_ahead()
        response.sent = time_message(time.time())
        return response
