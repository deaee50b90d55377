"""The driver node on the bus of a FaultBench, and a node that subscribes to its topics.

The test spins both nodes while it waits.
"""

import gc
from concurrent.futures import Future
from contextlib import ExitStack
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fault_bench import LAYOUT, FaultBench
from rclpy.parameter import Parameter
from ros_bench import TIMEOUT, RosBench

from tactile_node.nodes.driver_node import DriverNode
from tactile_node.ros.qos import STATUS_QOS, frames_qos
from tactile_skin.msg import SkinStatus, TaxelArray

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class DriverBench(RosBench):
    """The driver for one pad of ``bench``, with all messages that it publishes.

    ``given`` contains parameters of the driver.
    """

    def __init__(self, stack: ExitStack, bench: FaultBench, **given: Any):
        super().__init__(stack)
        stack.callback(self._forget)
        self.bench = bench
        given = {'interface': 'virtual', 'channel': bench.channel, 'pads': ['pad32'], 'node_ids': [32],
                 'layouts': [LAYOUT]} | given
        self.node = self.add(DriverNode(
            parameter_overrides=[Parameter(name, value=value) for name, value in given.items()]))
        self.listener = self.add('listener')
        self.taxels = self.listen(TaxelArray, '/pad32/taxels', frames_qos(50, False))
        self.diagnostics = self.listen(DiagnosticArray, '/diagnostics')
        self.status = self.listen(SkinStatus, '/skin_driver/status', STATUS_QOS)

    def _forget(self) -> None:
        """Drop the last reference to the node at once.

        If rclpy collected the node later, a new node of the same name would lose its /rosout publisher.
        """
        del self.node
        gc.collect()

    def listen(self, kind: type, topic: str, qos: Any = 10) -> list:
        """Return the list that collects the messages on ``topic``."""
        heard: list = []
        self.listener.create_subscription(kind, topic, heard.append, qos)
        return heard

    def call(self, kind: type, service: str, request: Any) -> Future:
        client = self.listener.create_client(kind, f'/skin_driver/{service}')
        self.until(client.service_is_ready, f'no {service}')
        return client.call_async(request)

    def answer(self, kind: type, service: str, request: Any) -> Any:
        call = self.call(kind, service, request)
        self.until(call.done, f'no answer of {service}')
        return call.result()

    def start(self) -> None:
        """Start the driver, and wait until both the bus and the node are reported without a fault."""
        self.node.autostart()
        self.until(lambda: (OK, OK) in self.levels, 'never OK')

    def set(self, name: str, value: Any) -> Any:
        """Set a parameter, and return the result after the chain has applied the value."""
        result = self.node.set_parameters([Parameter(name, value=value)])[0]
        assert self.node._stages.chain.wait_until_idle(TIMEOUT, with_postponed=False)
        return result

    @property
    def levels(self) -> list[tuple[bytes, ...]]:
        """Levels in each message on /diagnostics. The first level in each message is that of the bus."""
        return [tuple(status.level for status in message.status) for message in self.diagnostics]

    @property
    def reports(self) -> list[str]:
        """Text of each message on /diagnostics."""
        return [' '.join(status.message for status in message.status) for message in self.diagnostics]
