"""An action client of rclpy that any thread may use while another thread spins its node."""

import threading
from typing import Any

from rclpy.action import ActionClient


class LockedActionClient(ActionClient):
    """An ActionClient that takes no response while it sends a request.

    Without the lock, rclpy 7.1 drops a response that arrives before the call that sent the request has returned, and
    the future of the request never completes (https://github.com/ros2/rclpy/issues/1123).
    """

    def __init__(self, *args: Any, **options: Any):
        self._exchange = threading.Lock()
        super().__init__(*args, **options)

    def send_goal_async(self, *args: Any, **options: Any) -> Any:
        """Send a goal, and return the future of its goal handle."""
        with self._exchange:
            return super().send_goal_async(*args, **options)

    def take_data(self) -> Any:
        """Take the data that have arrived."""
        with self._exchange:
            return super().take_data()

    def _cancel_goal_async(self, goal_handle: Any) -> Any:
        with self._exchange:
            return super()._cancel_goal_async(goal_handle)

    def _get_result_async(self, goal_handle: Any) -> Any:
        with self._exchange:
            return super()._get_result_async(goal_handle)
