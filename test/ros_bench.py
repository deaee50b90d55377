"""Nodes of a test on one executor, which the test spins while it waits; the fixture `ros` of conftest.py ends them."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor

from tactile_node.ros.message_checks import check_contact_shape
from tactile_skin.msg import ContactFeatures, ContactShapes

TIMEOUT = 60.0  # s, for a busy machine


class RosBench:
    """Nodes that end with ``stack``."""

    def __init__(self, stack: ExitStack, executor: Executor | None = None):
        self.stack, self.executor = stack, executor or SingleThreadedExecutor()
        stack.callback(self.executor.shutdown)

    def add(self, node: Any) -> Any:
        """Take a node, or make a peer of this name."""
        node = rclpy.create_node(node) if isinstance(node, str) else node
        self.stack.callback(node.destroy_node)
        self.executor.add_node(node)
        return node

    def wait(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self.executor.spin_once(timeout_sec=min(0.005, left))

    def until(self, condition: Callable[[], object], failure: str = 'timeout') -> None:
        end = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < end, failure
            self.executor.spin_once(timeout_sec=0.01)


def features_fit(message: ContactFeatures) -> bool:
    """Whether pattern, state, contacts and features belong together."""
    touched = message.state == ContactFeatures.TOUCHED
    return (len(message.pattern) == message.rows * message.cols and any(message.pattern) == touched
            and bool(message.contacts) == bool(message.features) == touched)


def shapes_fit(message: ContactShapes) -> bool:
    """Whether every shape can be used, and state and contacts belong together."""
    touched = message.state == ContactShapes.TOUCHED
    return (len(message.shapes) <= message.contacts and bool(message.shapes) == bool(message.contacts) == touched
            and not any(map(check_contact_shape, message.shapes)))
