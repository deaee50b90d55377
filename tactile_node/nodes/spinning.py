"""Spins nodes beside the thread that starts and watches them."""

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

EVENTS_PERIOD = 1.0  # s, also the longest wait for entities
LONGEST_WAIT = 1.0  # s, of spin_once without a timeout
MOST_FAILURES = 3  # failed waits in a row: one is of an entity that was destroyed meanwhile


class FrameExecutor(SingleThreadedExecutor):
    """Runs callbacks, tasks of a hand-over and steady timers on one thread; another one waits for rclpy's entities.

    rclpy prepares every entity for every wait, and waits twice for a callback: 0.85 ms for the nodes of a gripper. What
    is handed over needs no such wait. Of the 120 entities half are event handlers (as "incompatible QoS"), which are
    looked at once a second.

    For `spin` and `spin_once`; ends with `shutdown`. Steady timers run whatever their callback group does; one that
    another thread makes shorter is late by LONGEST_WAIT at most.
    """

    def __init__(self, **options: Any):
        self._views: dict[Node, _View] = {}
        self._looked = -EVENTS_PERIOD
        self._work: SimpleQueue[Task | Exception | None] = SimpleQueue()
        self._found: Task | None = None  # by the waiting thread, which continues when it has run
        self._found_entity: Any = None
        self._has_run = threading.Semaphore(0)
        self._ended = threading.Event()
        self._watcher: threading.Thread | None = None
        super().__init__(**options)  # last: from now on a context that ends wakes this

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

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        """Run ``callback`` after what waits; a coroutine when the waiting thread finds it."""
        if inspect.iscoroutinefunction(callback) or inspect.iscoroutine(callback):
            return super().create_task(callback, *args, **kwargs)
        task = Task(callback, args, kwargs, executor=self)
        self._work.put(task)
        return task

    def add_node(self, node: Node) -> bool:
        """Look at the timers again, too."""
        is_added = super().add_node(node)
        self._work.put(None)
        return bool(is_added)

    def wake(self) -> None:
        """Look at the entities again: some were made or destroyed."""
        super().wake()
        self._work.put(None)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Run the timers that are due, and the first that comes within ``timeout_sec``; None, below 0: LONGEST_WAIT."""
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
            work.result()  # raises what it has raised

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """End the waiting thread, then as rclpy does."""
        self._ended.set()
        self._has_run.release()
        self.wake()
        if self._watcher is not None:
            self._watcher.join()
        if self._found is not None and not self._found.executing():
            self._found.cancel()
            if self._found_entity is not None:  # a task, as of an answer to an action client, has none
                self._found_entity._executor_event = False  # as its handler does: another executor may take it
        return bool(super().shutdown(timeout_sec))

    def _watch(self) -> None:
        """Wait for rclpy's entities, and again when the callback that was found has run."""
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
        """Take nothing of one that was destroyed since it was found: the only kind that rclpy does not ask."""
        try:
            return super()._take_waitable(waitable)
        except InvalidHandle:
            return None


def _is_steady(timer: Timer) -> bool:
    """Whether it runs on the steady clock, and its callback is no coroutine, which rclpy has to await."""
    return timer.clock.clock_type == ClockType.STEADY_TIME and not inspect.iscoroutinefunction(timer.callback)


def _call_if_due(timer: Timer) -> bool:
    try:
        with timer.handle:
            if not timer.handle.is_timer_ready():
                return False
            timer.handle.call_timer()
    except InvalidHandle:  # its node has just been destroyed
        return False
    timer.callback()
    return True


def _time_left(timer: Timer) -> float:
    """Return when it is due from now [s]; inf: cancelled or destroyed."""
    try:
        left = timer.time_until_next_call()
    except InvalidHandle:
        left = None
    return math.inf if left is None else max(left * 1e-9, 0.0)


class _View:
    """A node without its steady timers, with or without its event handlers."""

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
    """An executor on a thread; `check` raises what a callback has raised. ``on_death``: as of ReportedThread."""

    def __init__(self, nodes: Sequence[Node], on_death: OnDeath = lambda error: None):
        self._executor = FrameExecutor()
        self._error: Exception | None = None
        self._stopping = threading.Event()
        for node in nodes:
            self._executor.add_node(node)
        self._thread = ReportedThread(self._spin, 'executor', on_death=on_death, daemon=False)
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
