"""Spins nodes beside the thread that starts and watches them."""

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, cast

from rclpy.event_handler import EventHandler
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.waitable import Waitable

EVENTS_PERIOD = 1.0  # s


class FrameExecutor(SingleThreadedExecutor):
    """Looks once a second for QoS events (as "incompatible QoS"), instead of before each message.

    rclpy prepares every entity for every wait. Of the 120 of a gripper's nodes half are event handlers, and preparing
    them takes half of the time: 0.3 ms, some 200 times a second.
    """

    def __init__(self, **options: Any):
        super().__init__(**options)
        self._views: dict[Node, _View] = {}
        self._looked = -EVENTS_PERIOD

    def get_nodes(self) -> list[Node]:
        """Return the nodes as they are to be waited for now."""
        nodes = super().get_nodes()
        now = time.monotonic()
        with_events = now - self._looked >= EVENTS_PERIOD
        if with_events:
            self._looked = now
        # One view for each node: rclpy finds a task that is under way by its node.
        self._views = {node: self._views.get(node) or _View(node) for node in nodes}
        for view in self._views.values():
            view.with_events = with_events
        return cast(list[Node], list(self._views.values()))


class _View:
    """A node, with or without its event handlers."""

    def __init__(self, node: Node):
        self._node = node
        self.with_events = True

    @property
    def waitables(self) -> Iterator[Waitable]:
        return (each for each in self._node.waitables if self.with_events or not isinstance(each, EventHandler))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._node, name)


class Spinner:
    """An executor on a thread; `check` raises what a callback has raised, which the thread would lose."""

    def __init__(self, nodes: Sequence[Node]):
        self._executor = FrameExecutor()
        self._error: Exception | None = None
        self._stopping = threading.Event()
        for node in nodes:
            self._executor.add_node(node)
        self._thread = threading.Thread(target=self._spin, name='executor')
        self._thread.start()

    def check(self) -> None:
        """Raise what a callback has raised."""
        if self._error is not None:
            raise self._error

    def stop(self) -> None:
        """End the thread first: rclpy's shutdown destroys what a running callback still needs."""
        self._stopping.set()
        self._executor.create_task(lambda: None)  # wakes it up
        self._thread.join()
        self._executor.shutdown()

    def _spin(self) -> None:
        try:
            while not self._stopping.is_set():
                self._executor.spin_once()
        except ExternalShutdownException:
            pass
        except Exception as error:
            self._error = error


@contextmanager
def spinning(nodes: Sequence[Node]) -> Iterator[Spinner]:
    """Spin ``nodes`` inside the block."""
    spinner = Spinner(nodes)
    try:
        yield spinner
    finally:
        spinner.stop()
    spinner.check()
