"""Commands the gripper's own action, one command at a time; what it says of itself."""

import math
import time
from enum import Enum
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.node import Node

from tactile_node.grasp.closing import Outcome
from tactile_node.grasp.opening import LinearGap
from tactile_node.ros.gripper_messages import Command, GripperInterface, GripperState

STATE_AGE = 0.5  #: s, for which a position that the gripper has reported is its present one


class StopBy(Enum):
    """How a gripper is stopped."""

    CANCEL = 'cancel'  #: its action is cancelled, and it holds where it is
    GOAL = 'goal'      #: it is sent to where it is: for one that opens, or goes on, when it is cancelled

    @property
    def other(self) -> 'StopBy':
        return StopBy.GOAL if self is StopBy.CANCEL else StopBy.CANCEL


class _Sent:
    """One command on its way."""

    def __init__(self, holds: bool):
        self.holds = holds             # it stops the gripper where it is
        self.at = time.monotonic()
        self.handle: Any = None        # once it is accepted
        self.failure: Outcome | None = None
        self.result: GripperState | None = None
        self.is_cancelled = False


class GripperClient:
    """Each command carries ``effort``, the gripper's own limit: it is safe also when this process ends.

    ``law``: opening by the gripper's position. ``timeout`` [s]: for its answer to a command.
    """

    def __init__(self, node: Node, interface: GripperInterface, action: str, law: LinearGap, *, effort: float,
                 timeout: float):
        self._interface, self._law, self._effort, self._timeout = interface, law, effort, timeout
        self._client = ActionClient(node, interface.action, action)
        self._sent: _Sent | None = None
        self._state, self._stated = GripperState(), -math.inf

    def destroy(self) -> None:
        self._client.destroy()

    @property
    def opening(self) -> float:
        """Where the gripper says that it is [m]; NaN: not known, or too old."""
        is_current = time.monotonic() - self._stated <= STATE_AGE
        return self._law.gap(self._state.position) if is_current else math.nan

    @property
    def result(self) -> GripperState | None:
        """How the present command ended; None: it has not."""
        return self._sent.result if self._sent else None

    @property
    def is_stopped(self) -> bool:
        """Whether nothing moves by a command of ours, as far as the gripper has confirmed it."""
        sent = self._sent
        return (sent is None or sent.result is not None or sent.failure is Outcome.GRIPPER_REFUSED
                or sent.holds and sent.handle is not None)

    def failure(self, now: float) -> Outcome | None:
        """Return why the present command cannot be relied on at ``now`` [s]."""
        sent = self._sent
        if sent is None or sent.result is not None:
            return None
        if sent.failure is None and not self._client.server_is_ready():
            sent.failure = Outcome.NO_GRIPPER
        elif sent.failure is None and sent.handle is None and now - sent.at > self._timeout:
            sent.failure = Outcome.GRIPPER_SILENT
        return sent.failure

    def drive(self, opening: float, speed: float, *, holds: bool = False) -> None:
        """Send the gripper to ``opening`` [m] at ``speed`` [m/s]; 0: at its own. What it did before ends."""
        sent = self._sent = _Sent(holds)
        command = Command(self._law.reading(opening), abs(speed / self._law.scale), self._effort)
        future = self._client.send_goal_async(self._interface.goal(command),
                                              lambda message: self._take(message.feedback))
        future.add_done_callback(lambda done: self._on_answer(sent, done))

    def stop(self, by: StopBy) -> None:
        """Have it hold where it is."""
        if by is StopBy.GOAL and math.isfinite(self.opening):
            self.drive(self.opening, 0.0, holds=True)
        elif self._sent is not None:
            self._cancel(self._sent)

    def _cancel(self, sent: _Sent) -> None:
        """Cancel now, or as soon as the gripper accepts the command."""
        sent.is_cancelled = True
        if sent.handle is not None:
            sent.handle.cancel_goal_async()

    def _on_answer(self, sent: _Sent, future: Any) -> None:
        handle = future.result()
        if not handle.accepted:
            sent.failure = Outcome.GRIPPER_REFUSED
            return
        sent.handle = handle
        if sent.is_cancelled:
            handle.cancel_goal_async()
        handle.get_result_async().add_done_callback(lambda done: self._on_result(sent, done))

    def _on_result(self, sent: _Sent, future: Any) -> None:
        answer = future.result()
        state = self._interface.state(answer.result)
        if answer.status == GoalStatus.STATUS_SUCCEEDED and not state.stalled:
            state = state._replace(reached_goal=True)  # not every gripper fills it in
        sent.result = state
        if sent is self._sent:
            self._note(state)

    def _take(self, feedback: Any) -> None:
        self._note(self._interface.state(feedback))

    def _note(self, state: GripperState) -> None:
        if math.isfinite(state.position):
            self._state, self._stated = state, time.monotonic()
