"""Runs the steps of a lifecycle node: an error makes the transition fail, is logged and kept."""

import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node

from tactile_node.errors import DeviceError, TactileError
from tactile_node.threads.reminder import Reminder

WAITING = 'The driver waits for it.'


class LifecycleSteps:
    """The steps of ``node``; ``error`` is the last one's, None after a success or an unforeseen exception."""

    def __init__(self, node: Node):
        self._node = node
        self._reminder: Reminder | None = None
        self._waits_for: tuple[type[TactileError], ...] = ()
        self.error: TactileError | None = None

    @contextmanager
    def autostart(self, waits_for: tuple[type[TactileError], ...]) -> Iterator[None]:
        """Inside the block, a step that fails with one of these errors is repeated: log each when a reminder is due.

        Any other error ends the block and is reported where it is caught, so that it is reported once.
        """
        self._reminder, self._waits_for = Reminder(), waits_for
        try:
            yield
        finally:
            self._reminder = None

    def attempt(self, step: Callable[[], None]) -> TransitionCallbackReturn:
        """Run ``step`` and return the result of its transition."""
        try:
            step()
        except TactileError as error:
            self.error = error
            self._log(error)
            return TransitionCallbackReturn.FAILURE
        except Exception:  # rclpy would discard it without a message
            self.error = None
            self._node.get_logger().error(traceback.format_exc())
            return TransitionCallbackReturn.FAILURE
        self.error = None
        return TransitionCallbackReturn.SUCCESS

    def failure(self, transition: str) -> TactileError:
        """Return what to raise for a ``transition`` that has failed."""
        return self.error or DeviceError('skin driver', expected=f'to {transition}', got='an unforeseen error',
                                         remedy='The log above has it.')

    def _log(self, error: TactileError) -> None:
        if self._reminder is None:
            self._node.get_logger().error(str(error))
        elif isinstance(error, self._waits_for) and self._reminder.is_due(str(error), time.monotonic()):
            self._node.get_logger().error(f'{error} {WAITING}')
