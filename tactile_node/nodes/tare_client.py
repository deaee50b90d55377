"""Calls the service `~/tare` of a running driver, for a program that is no node."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.parameter_client import AsyncParameterClient
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from tactile_node.errors import ConfigurationError
from tactile_node.node_graph import NODE_NAMES, Role
from tactile_node.nodes.driver_services import LONGEST
from tactile_node.nodes.run import translate_rclpy_errors
from tactile_skin.srv import Tare

DRIVER = NODE_NAMES[Role.DRIVER]
DISCOVERY_TIMEOUT = 15.0  #: for the driver to be found [s]
ANSWER_TIMEOUT = LONGEST + 10  #: [s]


class TareClient:
    """Asks the driver in the namespace of ``node``. Raises ConfigurationError where none runs or answers."""

    def __init__(self, node: Node):
        self._node = node
        self._client = node.create_client(Tare, f'{DRIVER}/tare')
        if not self._client.wait_for_service(DISCOVERY_TIMEOUT):
            drivers = [name.rpartition('/')[0] for name, kinds in node.get_service_names_and_types()
                       if 'tactile_skin/srv/Tare' in kinds and name != self._client.service_name]
            raise self._refusal('none' + (f', but {", ".join(drivers)}' if drivers else ''))

    def pads(self) -> list[str]:
        """Return the names of the driver's pads."""
        answer = self._answer(AsyncParameterClient(self._node, DRIVER).get_parameters(['pads']))
        return list(answer.values[0].string_array_value)

    def tare(self, pad: str, frames: int, on_device: bool) -> Tare.Response:
        """Return the answer for one pad; ``frames`` to average, 0: as many as the driver has by default."""
        return self._answer(self._client.call_async(Tare.Request(pads=[pad], frames=frames, on_device=on_device)))

    def _answer(self, future: Future) -> Any:
        end = time.monotonic() + ANSWER_TIMEOUT
        while not future.done():
            if time.monotonic() > end:
                raise self._refusal(f'one that has not answered for {ANSWER_TIMEOUT:g} s')
            rclpy.spin_once(self._node, timeout_sec=0.1)  # in short steps, or Ctrl-C would have to wait
        return future.result()

    def _refusal(self, got: str) -> ConfigurationError:
        return ConfigurationError(
            f'tare by {self._client.service_name.rpartition("/")[0]}', expected='a running driver', got=got,
            remedy='Start it (`tactile bringup`, or the launch file), or give its --namespace. It is found with the '
                   'same ROS_DOMAIN_ID only.')


@contextmanager
def tare_client(namespace: str) -> Iterator[TareClient]:
    """Give a client of the driver in ``namespace``, '' for the root. Raises ConfigurationError."""
    with translate_rclpy_errors():
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = Node('tactile_tare', namespace=namespace)
    try:
        yield TareClient(node)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
