"""Call the service `~/tare` of a running driver from a program that is not a ROS node."""

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
DISCOVERY_TIMEOUT = 15.0  #: Time allowed for discovering the driver [s].
ANSWER_TIMEOUT = LONGEST + 10  #: Time allowed for a response from the driver [s].


class TareClient:
    """Client of the driver that runs in the namespace of ``node``.

    The constructor and the methods raise ConfigurationError if no driver is found or if the driver does not respond.
    """

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
        """Tare one pad and return the driver's response.

        Parameters
        ----------
        pad : str
            Name of the pad.
        frames : int
            Number of taxel frames to average; 0 selects the driver's default.
        on_device : bool
            True if the devices of the pad must first zero themselves.
        """
        return self._answer(self._client.call_async(Tare.Request(pads=[pad], frames=frames, on_device=on_device)))

    def _answer(self, future: Future) -> Any:
        end = time.monotonic() + ANSWER_TIMEOUT
        while not future.done():
            if time.monotonic() > end:
                raise self._refusal(f'a driver that has not answered for {ANSWER_TIMEOUT:g} s')
            rclpy.spin_once(self._node, timeout_sec=0.1)  # a short timeout, so that Ctrl-C takes effect soon
        return future.result()

    def _refusal(self, got: str) -> ConfigurationError:
        return ConfigurationError(
            f'tare by {self._client.service_name.rpartition("/")[0]}', expected='a running driver', got=got,
            remedy='Start the driver (`tactile bringup`, or the launch file), or give its namespace with --namespace. '
                   'Use the same ROS_DOMAIN_ID as the driver.')


@contextmanager
def tare_client(namespace: str) -> Iterator[TareClient]:
    """Yield a client of the driver in ``namespace``, where '' is the root namespace.

    Raises ConfigurationError under the same conditions as `TareClient`.
    """
    with translate_rclpy_errors():
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = Node('tactile_tare', namespace=namespace)
    try:
        yield TareClient(node)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
