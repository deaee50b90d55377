"""Nodes of a test on one executor, which the test spins while it waits.

The fixture `ros` in conftest.py destroys these nodes.
"""

import math
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import partial
from typing import Any

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import Executor, SingleThreadedExecutor, TimeoutException

from tactile_node.nodes.spinner import SpinnerExecutor
from tactile_node.ros.message_checks import check_contact_shape
from tactile_skin.msg import ContactFeatures, ContactShapes

TIMEOUT = 60.0  #: Time limit on a busy machine [s].


class LeanExecutor(SpinnerExecutor):
    """A SpinnerExecutor that never checks event handlers, because tests with a TimedBench do not need them."""

    def __init__(self):
        super().__init__()
        self._looked = math.inf


class RosBench:
    """Nodes that are destroyed when ``stack`` is closed."""

    def __init__(self, stack: ExitStack, executor: Executor | None = None):
        self.stack, self.executor = stack, executor or SingleThreadedExecutor()
        stack.callback(self.executor.shutdown)

    def add(self, node: Any) -> Any:
        """Add a node to the executor. If ``node`` is a name, a plain node of this name is created first."""
        node = rclpy.create_node(node, start_parameter_services=False) if isinstance(node, str) else node
        self.stack.callback(node.destroy_node)
        self.executor.add_node(node)
        return node

    def wait(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self.executor.spin_once(timeout_sec=left)

    def until(self, condition: Callable[[], object], failure: str = 'timeout') -> None:
        end = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < end, failure
            self.executor.spin_once(timeout_sec=0.01)

    def settle(self) -> None:
        """Run callbacks until none is ready and no chain has work.

        Between nodes of one process, a message arrives at the moment it is sent.
        """
        is_busy = True
        while is_busy:
            is_busy = False
            for node in self.executor.get_nodes():
                if (stages := getattr(node, '_stages', None)) is not None:
                    assert stages.chain.wait_until_idle(TIMEOUT)
            with suppress(TimeoutException):
                while True:
                    task, _, _ = self.executor.wait_for_ready_callbacks(timeout_sec=0)
                    is_busy = True
                    task()
                    if task.exception() is not None:
                        raise task.exception()


class VirtualTime:
    """A steady clock that stands still until the test advances it, with the timers that use it."""

    def __init__(self) -> None:
        self.nanoseconds = 1000 * 10**9
        self.timers: list[VirtualTimer] = []

    def now(self) -> float:
        return self.nanoseconds * 1e-9

    def advance(self, seconds: float) -> None:
        """Advance the clock by ``seconds``, and call the timers that become due."""
        self.nanoseconds += round(seconds * 1e9)
        for timer in self.timers:
            timer.look()

    def of(self, kind: type) -> type:
        """Return a subclass of ``kind`` whose timers use this clock and are removed with the node."""
        def create_timer(node: Any, period: float, callback: Callable[[], None], clock: Clock) -> 'VirtualTimer':
            assert clock.clock_type == ClockType.STEADY_TIME, 'another clock stands still without /clock'
            self.timers.append(VirtualTimer(self, period, callback, node))
            return self.timers[-1]

        def tick(node: Any, period: float, call: Callable[[], None]) -> None:
            self.timers.append(VirtualTimer(self, period, call, node))

        def destroy_node(node: Any) -> None:
            self.timers = [each for each in self.timers if each.node is not node]
            kind.destroy_node(node)
        return type(kind.__name__, (kind,), {'create_timer': create_timer, 'tick': tick, 'destroy_node': destroy_node})


class VirtualTimer:
    """The part of an rclpy timer that our nodes use."""

    def __init__(self, clock: VirtualTime, period: float, callback: Callable[[], None], node: Any):
        self._clock = clock
        self.node = node
        self._callback = callback
        self.timer_period_ns = round(period * 1e9)
        self.reset()

    def reset(self) -> None:
        self._due: float = self._clock.nanoseconds + self.timer_period_ns

    def cancel(self) -> None:
        self._due = math.inf

    def look(self) -> None:
        if self._clock.nanoseconds >= self._due:
            self._due += self.timer_period_ns
            self._callback()


class TimedBench(RosBench):
    """Nodes that share one clock.

    The clock advances by ``step`` [s] once all sent messages have arrived and been processed.

    The clock is virtual, so that tests are exact even on a slow machine. With ``is_real_time``, the clock is the real
    steady clock.
    """

    def __init__(self, stack: ExitStack, step: float, executor: Executor | None = None, *, is_real_time: bool = False):
        super().__init__(stack, executor or LeanExecutor())
        self._step = step
        self.time = None if is_real_time else VirtualTime()
        self.steady = time.monotonic if self.time is None else self.time.now

    def timed(self, kind: type) -> Callable[..., Any]:
        """Return a function that creates a node of ``kind`` on this clock."""
        return kind if self.time is None else partial(self.time.of(kind), steady=self.steady)

    def on_step(self) -> None:
        """Do the part of a clock step's work that belongs to no node."""

    def step(self) -> None:
        if self.time is None:
            super().wait(self._step)
            self.on_step()
            return
        self.time.advance(self._step)
        self.on_step()
        self.settle()

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / self._step)):
            self.step()

    def until(self, condition: Callable[[], object], failure: str = 'timeout') -> None:
        end = self.steady() + TIMEOUT
        while not condition():
            assert self.steady() < end, failure
            self.step()

    def until_joined(self, condition: Callable[[], object]) -> None:
        """Wait in real time until the middleware has matched the endpoints."""
        super().until(condition)


def features_fit(message: ContactFeatures) -> bool:
    """Return True if the message's pattern, state, contacts and features are consistent."""
    touched = message.state == ContactFeatures.TOUCHED
    return (len(message.pattern) == message.rows * message.cols and any(message.pattern) == touched
            and bool(message.contacts) == bool(message.features) == touched)


def shapes_fit(message: ContactShapes) -> bool:
    """Return True if every shape in the message is usable, and the state matches the contacts."""
    touched = message.state == ContactShapes.TOUCHED
    return (len(message.shapes) <= message.contacts and bool(message.shapes) == bool(message.contacts) == touched
            and not any(map(check_contact_shape, message.shapes)))
