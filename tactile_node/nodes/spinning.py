"""Spin nodes on a separate thread, which another thread starts and supervises."""

import inspect
import math
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from typing import Any, cast

from rclpy.clock import ClockType
from rclpy.event_handler import EventHandler
from rclpy.exceptions import InvalidHandle
from rclpy.executors import (
    ConditionReachedException,
    ExternalShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
)
from rclpy.node import Node
from rclpy.task import Task
from rclpy.timer import Timer
from rclpy.waitable import Waitable

from tactile_node.threads import OnDeath, ReportedThread

EVENTS_PERIOD = 1.0  #: Time between two checks of the event handlers, and longest wait for other entities [s].
LONGEST_WAIT = 1.0  #: Longest wait of spin_once without a timeout [s].
#: Maximum number of consecutive failed waits. A single wait may fail because an entity is destroyed meanwhile.
MOST_FAILURES = 3


class FrameExecutor(SingleThreadedExecutor):
    """Executor that runs callbacks, hand-over tasks and steady timers on one thread.

    A second thread waits for the entities of rclpy, such as subscriptions. A wait is slow, because rclpy prepares every
    entity for every wait, and waits twice per callback. For the nodes of a gripper, both waits take 0.85 ms. Results
    that are handed over need no wait. Half of the 120 entities are event handlers (such as "incompatible QoS"), which
    are checked only once a second.

    The executor supports `spin`, `spin_once` and `shutdown`. Steady timers run regardless of their callback group. If
    another thread shortens the period of a steady timer, the next call of that timer is at most LONGEST_WAIT late.
    """

    def __init__(self, **options: Any):
        self._views: dict[Node, _View] = {}
        self._looked = -EVENTS_PERIOD
        self._work: SimpleQueue[Task | Exception | None] = SimpleQueue()
        self._found: Task | None = None  # task found by the waiting thread, which pauses until the task has run
        self._found_entity: Any = None
        self._has_run = threading.Semaphore(0)
        self._ended = threading.Event()
        self._watcher: threading.Thread | None = None
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

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        """Queue a callback behind the waiting callbacks. A coroutine runs when the waiting thread finds it.

        Parameters
        ----------
        callback : callable
            Function or coroutine.
        *args, **kwargs
            Its arguments.
        """
        if inspect.iscoroutinefunction(callback) or inspect.iscoroutine(callback):
            return super().create_task(callback, *args, **kwargs)
        task = Task(callback, args, kwargs, executor=self)
        self._work.put(task)
        return task

    def add_node(self, node: Node) -> bool:
        """Add a node, and make ``spin_once`` read its timers. Returns True if the node was added."""
        is_added = super().add_node(node)
        self._work.put(None)
        return bool(is_added)

    def wake(self) -> None:
        """Make both threads read the entities again, because entities were created or destroyed."""
        super().wake()
        self._work.put(None)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run all due timers, then wait for a task and run it.

        Parameters
        ----------
        timeout_sec : float or None
            Longest wait for a task [s]. None or a negative value selects LONGEST_WAIT.
        """
        if not self._context.ok():
            raise ExternalShutdownException
        if self._watcher is None:
            self._watcher = ReportedThread(self._watch, 'entities')
            self._watcher.start()
        timers = [timer for node in super().get_nodes() for timer in node.timers if _is_steady(timer)]
        waits = [0.0 if _call_if_due(timer) else _time_left(timer) for timer in timers]
        limit = LONGEST_WAIT if timeout_sec is None or timeout_sec < 0 else timeout_sec
        try:
            work = self._work.get(timeout=min([*waits, limit]))
        except Empty:
            return
        if isinstance(work, Exception):
            self._watcher = None
            raise work
        if work is not None:
            try:
                work()
            finally:
                if work is self._found:
                    self._has_run.release()
            work.result()  # raises the exception of the callback, if there was one

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """End the waiting thread, then shut down as rclpy does. Returns True if the shutdown was complete."""
        self._ended.set()
        self._has_run.release()
        self.wake()
        if self._watcher is not None:
            self._watcher.join()
        if self._found is not None and not self._found.executing():
            self._found.cancel()
            if self._found_entity is not None:  # None, for example, for a response to an action client
                self._found_entity._executor_event = False  # lets another executor take the entity
        return bool(super().shutdown(timeout_sec))

    def _watch(self) -> None:
        """Wait for the entities of rclpy. After finding a callback, pause until the callback has run."""
        failures = 0
        while not self._ended.is_set():
            try:
                self._found, self._found_entity, _ = self.wait_for_ready_callbacks(
                    EVENTS_PERIOD, None, self._ended.is_set)
            except ConditionReachedException:
                return
            except TimeoutException:
                failures = 0
            except Exception as error:
                failures += 1
                if failures > MOST_FAILURES or isinstance(error, ExternalShutdownException):
                    self._work.put(error)
                    return
            else:
                failures = 0
                self._work.put(self._found)
                self._has_run.acquire()

    def _take_waitable(self, waitable: Waitable) -> Any:
        """Return None for a waitable that was destroyed after it was found, because rclpy would raise an exception."""
        try:
            return super()._take_waitable(waitable)
        except InvalidHandle:
            return None


def _is_steady(timer: Timer) -> bool:
    """Return True for a timer on the steady clock, unless its callback is a coroutine, which rclpy must await."""
    return timer.clock.clock_type == ClockType.STEADY_TIME and not inspect.iscoroutinefunction(timer.callback)


def _call_if_due(timer: Timer) -> bool:
    try:
        with timer.handle:
            if not timer.handle.is_timer_ready():
                return False
            timer.handle.call_timer()
    except InvalidHandle:  # the node was destroyed a moment ago
        return False
    timer.callback()
    return True


def _time_left(timer: Timer) -> float:
    """Return the time until the next call of a timer [s], or inf if the timer is cancelled or destroyed."""
    try:
        left = timer.time_until_next_call()
    except InvalidHandle:
        left = None
    return math.inf if left is None else max(left * 1e-9, 0.0)


class _View:
    """View of a node without its steady timers, and without its event handlers unless ``with_events`` is true."""

    def __init__(self, node: Node):
        self._node = node
        self.with_events = True

    @property
    def waitables(self) -> Iterator[Waitable]:
        return (each for each in self._node.waitables if self.with_events or not isinstance(each, EventHandler))

    @property
    def timers(self) -> Iterator[Timer]:
        return (each for each in self._node.timers if not _is_steady(each))

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
        self._executor = FrameExecutor()
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
        self._executor.create_task(lambda: None)  # wakes the thread
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
