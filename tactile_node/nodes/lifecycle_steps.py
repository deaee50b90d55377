"""Runs the steps of a lifecycle node: an error makes the transition fail, is logged and kept.

A transition that the state does not allow is refused.
"""

import logging
import time
import traceback
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.node import Node

from tactile_node.bus.message_pace import Reminder
from tactile_node.errors import DeviceError, TactileError
from tactile_node.ros.rosout_handler import PACKAGE_LOGGER, RosoutHandler

logger = logging.getLogger(__name__)

WAITING = 'The driver waits for it.'


class LifecycleSteps:
    """The steps of ``node``; ``error`` is the last one's, None after a success or an unforeseen exception."""

    def __init__(self, node: Node):
        self._node = node
        self._waits_for: tuple[type[TactileError], ...] | None = None  # None: not within `autostart`
        self.error: TactileError | None = None

    @contextmanager
    def autostart(self, waits_for: tuple[type[TactileError], ...]) -> Iterator[None]:
        """Inside the block, a step that fails with one of these errors is repeated: each text is logged when it is due.

        Any other error ends the block and is reported where it is caught, so that it is reported once.
        """
        reminders: defaultdict[str, Reminder] = defaultdict(Reminder)

        def is_due(record: logging.LogRecord) -> bool:
            return reminders[record.getMessage()].is_due(record.getMessage(), time.monotonic())
        package = logging.getLogger(PACKAGE_LOGGER)
        forwarding = next(each for each in package.handlers if isinstance(each, RosoutHandler))
        forwarding.addFilter(is_due)
        self._waits_for = waits_for
        try:
            yield
        finally:
            self._waits_for = None
            forwarding.removeFilter(is_due)

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
        if self._waits_for is None:
            self._node.get_logger().error(str(error))
        elif isinstance(error, self._waits_for):
            logger.error('%s %s', error, WAITING, extra={'fact': error})


def reject_invalid_transitions(node: LifecycleNode) -> None:
    """Answer a request for a transition that the node's state does not allow with success = False.

    rclpy raises in its callback (RCLError: "Transition is not registered"), which would end the process; a lifecycle
    manager that repeats itself would do that.
    """
    service = next(service for service in node.services if service.srv_type is ChangeState)
    change = service.callback

    def answer(request: ChangeState.Request, response: ChangeState.Response) -> ChangeState.Response:
        try:
            return change(request, response)
        except RuntimeError as error:
            node.get_logger().error(f'change_state: expected a transition that the present state allows, got '
                                    f'{request.transition.label or request.transition.id} ({error}). '
                                    'Ask ~/get_available_transitions.')
            response.success = False
            return response
    service.callback = answer
