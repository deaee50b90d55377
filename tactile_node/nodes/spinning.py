"""Spins nodes beside the thread that starts and watches them."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from tactile_node.nodes.frame_executor import FrameExecutor


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
