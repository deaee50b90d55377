"""Spin nodes on a separate thread, which another thread starts and supervises."""

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, cast

from rclpy.event_handler import EventHandler
from rclpy.exceptions import InvalidHandle
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from rclpy.waitable import Waitable

from tactile_node.threads import OnDeath, ReportedThread

EVENTS_PERIOD = 1.0  #: Time between two checks of the event handlers [s].
#: Maximum number of consecutive failed waits. A single wait may fail because an entity is destroyed meanwhile.
MOST_FAILURES = 3


class SpinnerExecutor(SingleThreadedExecutor):
    """A SingleThreadedExecutor that checks event handlers, such as "incompatible QoS", only once a second.

    rclpy prepares every entity for every wait. For the nodes of a gripper, half of the 120 entities are event handlers.
    """

    def __init__(self, **options: Any):
        self._views: dict[Node, _View] = {}
        self._looked = -EVENTS_PERIOD
        super().__init__(**options)  # called last, because from then on, the context calls wake when it ends

    def get_nodes(self) -> list[Node]:
        """Return views of the nodes with the entities to wait for; called by rclpy before each wait."""
        nodes = super().get_nodes()
        now = time.monotonic()
        with_events = now - self._looked >= EVENTS_PERIOD
        if with_events:
            self._looked = now
        # Each node must keep its view object, because rclpy finds a running task by its node.
        self._views = {node: self._views.get(node) or _View(node) for node in nodes}
        for view in self._views.values():
            view.with_events = with_events
        return cast(list[Node], list(self._views.values()))

    def _take_waitable(self, waitable: Waitable) -> Any:
        """Return None for a waitable that was destroyed after it was found, because rclpy would raise an exception."""
        try:
            return super()._take_waitable(waitable)
        except InvalidHandle:
            return None


class _View:
    """View of a node without its event handlers unless ``with_events`` is true."""

    def __init__(self, node: Node):
        self._node = node
        self.with_events = True

    @property
    def waitables(self) -> Iterator[Waitable]:
        return (each for each in self._node.waitables if self.with_events or not isinstance(each, EventHandler))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._node, name)


class Spinner:
    """A thread that spins nodes.

    Parameters
    ----------
    nodes : sequence of Node
        Nodes to spin.
    on_death : callable
        Function that is called with the exception if a callback ends the thread.
    """

    def __init__(self, nodes: Sequence[Node], on_death: OnDeath = lambda error: None):
        self._executor = SpinnerExecutor()
        self._error: Exception | None = None
        self._stopping = threading.Event()
        for node in nodes:
            self._executor.add_node(node)
        self._thread = ReportedThread(self._spin, 'executor', on_death=on_death, daemon=False)
        self._thread.start()

    def check(self) -> None:
        """If an exception in a callback has ended the thread, raise that exception."""
        if self._error is not None:
            raise self._error

    def stop(self) -> None:
        """End the thread before the executor, because the shutdown destroys objects that a running callback needs."""
        self._stopping.set()
        self._executor.create_task(lambda: None)  # a wait without a task would last until its timeout
        self._thread.join()
        self._executor.shutdown()

    def _spin(self) -> None:
        failures = 0
        try:
            while not self._stopping.is_set():
                try:
                    task, _, _ = self._executor.wait_for_ready_callbacks(EVENTS_PERIOD)
                except TimeoutException:
                    failures = 0
                    continue
                except ExternalShutdownException:
                    return
                except Exception:
                    failures += 1
                    if failures > MOST_FAILURES:
                        raise
                    continue
                failures = 0
                task()
                task.result()  # raises the exception of the callback, if there was one
        except ExternalShutdownException:
            pass
        except Exception as error:
            self._error = error
            raise


@contextmanager
def spinning(nodes: Sequence[Node]) -> Iterator[Spinner]:
    """Spin ``nodes`` inside the block."""
    spinner = Spinner(nodes)
    try:
        yield spinner
    finally:
        spinner.stop()
    spinner.check()
