"""Run the transition steps of a lifecycle node, and refuse transitions that its state does not allow.

If a step raises an error, the error is logged and stored, and the transition fails.
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

from tactile_node.bus.log_throttle import LogThrottle
from tactile_node.errors import DeviceError, TactileError
from tactile_node.ros.rosout_handler import PACKAGE_LOGGER, RosoutHandler

logger = logging.getLogger(__name__)

WAITING = 'The driver keeps waiting.'


class LifecycleSteps:
    """Runs the transition steps of one node.

    Parameters
    ----------
    node : Node
        Node whose logger reports the errors.

    Attributes
    ----------
    error : TactileError or None
        Error of the last step, or None if the step succeeded or raised an unexpected exception.
    """

    def __init__(self, node: Node):
        self._node = node
        self._waits_for: tuple[type[TactileError], ...] | None = None  # None outside ``autostart``
        self.error: TactileError | None = None

    @contextmanager
    def autostart(self, waits_for: tuple[type[TactileError], ...]) -> Iterator[None]:
        """Limit the log messages inside the block, where the caller retries failed steps.

        A repeated message is logged at increasing intervals. Errors that are not in ``waits_for`` are not logged inside
        the block, because they end the block and are reported by the code that catches them.

        Parameters
        ----------
        waits_for : tuple of error types
            Errors after which the caller retries the step.
        """
        throttles: defaultdict[str, LogThrottle] = defaultdict(LogThrottle)

        def is_due(record: logging.LogRecord) -> bool:
            return throttles[record.getMessage()].is_due(record.getMessage(), time.monotonic())
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
        """Run a step and return the result of its transition.

        Parameters
        ----------
        step : callable
            Step to run. If the step raises an exception, the transition fails.
        """
        try:
            step()
        except TactileError as error:
            self.error = error
            self._log(error)
            return TransitionCallbackReturn.FAILURE
        except Exception:  # rclpy would silently discard the exception
            self.error = None
            self._node.get_logger().error(traceback.format_exc())
            return TransitionCallbackReturn.FAILURE
        self.error = None
        return TransitionCallbackReturn.SUCCESS

    def failure(self, transition: str) -> TactileError:
        """Return the error to raise after the transition named ``transition`` has failed."""
        return self.error or DeviceError('skin driver', expected=f'to {transition}', got='an unforeseen error',
                                         remedy='See the traceback in the log above.')

    def _log(self, error: TactileError) -> None:
        if self._waits_for is None:
            self._node.get_logger().error(str(error))
        elif isinstance(error, self._waits_for):
            logger.error('%s %s', error, WAITING, extra={'fact': error})


def reject_invalid_transitions(node: LifecycleNode) -> None:
    """Make a node respond with success = False to a request for a transition that its state does not allow.

    For such a request, rclpy's own callback raises an exception (RCLError: "Transition is not registered"), which would
    end the process. A lifecycle manager that repeats a request would therefore end the driver.
    """
    service = next(service for service in node.services if service.srv_type is ChangeState)
    change = service.callback

    def answer(request: ChangeState.Request, response: ChangeState.Response) -> ChangeState.Response:
        try:
            return change(request, response)
        except RuntimeError as error:
            node.get_logger().error(f'change_state: expected a transition that the current state allows, got '
                                    f'{request.transition.label or request.transition.id} ({error}). '
                                    'Call ~/get_available_transitions to list them.')
            response.success = False
            return response
    service.callback = answer
