"""A goal of the action `~/put_down`, as a planner sees it."""

import math
from collections.abc import Callable
from typing import Any

from tactile_skin.action import PutDown

#: Age above which a feedback no longer lets the arm move [s]. An arm that looks every 0.01 s stops within 0.2 s after
#: the feedback has ceased.
FEEDBACK_LIMIT = 0.12


class PutDownGoal:
    """A goal that was sent.

    Parameters
    ----------
    steady : callable
        Steady clock [s].

    Attributes
    ----------
    handle : ClientGoalHandle or None
        rclpy's goal handle, or None until the goal is accepted.
    result : PutDown.Result or None
        Result, or None until the goal has ended. A goal whose server has died never ends.
    heard : float
        Time of the latest feedback [s]; -inf before the first one.
    """

    def __init__(self, steady: Callable[[], float]):
        self._steady = steady
        self._watches = False
        self.handle: Any = None
        self.result: PutDown.Result | None = None
        self.heard = -math.inf

    @property
    def is_current(self) -> bool:
        """True while feedback arrives and the goal has not ended. If it is False, the arm must stop."""
        return self.result is None and self._steady() - self.heard <= FEEDBACK_LIMIT

    @property
    def is_watching(self) -> bool:
        """True if the goal is current and can detect a touch, because the baseline is complete."""
        return self.is_current and self._watches

    def cancel(self) -> Any:
        """Cancel the goal and return rclpy's future. The goal must have been accepted."""
        return self.handle.cancel_goal_async()

    def on_feedback(self, message: Any) -> None:
        self._watches, self.heard = message.feedback.watching, self._steady()

    def on_answer(self, future: Any) -> None:
        """Store the handle of an accepted goal and request its result."""
        handle = future.result()
        if not handle.accepted:
            self.result = PutDown.Result(message='the goal was rejected', outcome=PutDown.Result.REFUSED)
            return
        self.handle = handle
        handle.get_result_async().add_done_callback(self._on_result)

    def _on_result(self, future: Any) -> None:
        self.result = future.result().result
