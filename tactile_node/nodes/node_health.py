"""Publish the health of a message-processing node on /diagnostics once a second."""

import logging
import math
import time
from collections.abc import Callable, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from rclpy.qos import QoSProfile

from tactile_node.nodes.guarded_input import GuardedInput
from tactile_node.nodes.ticker import Ticker
from tactile_node.ros.message_age import use_stamps
from tactile_node.ros.message_health import (
    StreamFault,
    StreamHealth,
    health_status,
    several_text,
    topics_of_several,
)
from tactile_node.ros.rosout_handler import of_node
from tactile_node.ros.settings import ReceiverSettings

logger = logging.getLogger(__name__)


class MessageHealth:
    """Publishes the health of a node's inputs on /diagnostics for as long as the node exists.

    The message stamps are compared with the clock of this host, unless the time is simulated or comes from a lossless
    replay.

    Parameters
    ----------
    node : Node
        Node whose health is published.
    inputs : sequence of GuardedInput
        Inputs of the node.
    settings : ReceiverSettings
        Settings of the node.
    """

    def __init__(self, node: Node, inputs: Sequence[GuardedInput[Any]], settings: ReceiverSettings):
        self._node = node
        self._max_clock_offset = settings.max_clock_offset if use_stamps(node, settings) else math.inf
        self._inputs = tuple(inputs)
        self._before = {each.topic: each.counts for each in inputs}
        self._at = time.monotonic()
        self._of_several: set[str] = set()  # topics that were already reported
        publish_status(node, self._status)

    def _status(self) -> DiagnosticStatus:
        now, at = {each.topic: each.health for each in self._inputs}, time.monotonic()
        status = health_status(self._node.get_fully_qualified_name(), now, self._before, at - self._at,
                               self._max_clock_offset)
        self._log_several(now)
        self._before, self._at = {topic: stream.counts for topic, stream in now.items()}, at
        return status

    def _log_several(self, now: dict[str, StreamHealth]) -> None:
        """Log each topic with several publishers once, and again only if it had a single publisher in between."""
        found = topics_of_several(now)
        for topic in found.keys() - self._of_several:
            logger.warning('%s', several_text(topic, found[topic]),
                           extra=of_node(self._node, fact=StreamFault.SEVERAL_PUBLISHERS))
        self._of_several = set(found)


HEALTH_PERIOD = 1.0  #: Time between two messages on /diagnostics [s] (REP-107).


def publish_status(node: Node, status: Callable[[], DiagnosticStatus]) -> None:
    """Publish a status on /diagnostics once a second, as long as the node exists.

    The stamp comes from the node's clock. With use_sim_time, the stamp is 0 until the first message on /clock, but the
    status is still published.

    Parameters
    ----------
    node : Node
        Node that publishes.
    status : callable
        Function that returns the status to publish.
    """
    publisher = node.create_publisher(DiagnosticArray, '/diagnostics', QoSProfile(depth=10))

    def publish() -> None:
        message = DiagnosticArray(status=[status()])
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)
    Ticker(node, HEALTH_PERIOD, publish, on_executor=True)
