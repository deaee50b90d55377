"""Commands the gripper's own action, one command at a time; what it says of itself."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.node import Node

from tactile_node.grasp.closing import Outcome
from tactile_node.grasp.opening import LinearGap
from tactile_node.ros.gripper_messages import Command, GripperInterface, GripperState


class _Sent:
    """One command on its way."""

    def __init__(self, holds: bool, at: float):
        self.holds = holds             # it stops the gripper where it is
        self.at = at                   # [s]
        self.handle: Any = None        # once it is accepted
        self.failure: Outcome | None = None
        self.result: GripperResult | None = None
        self.is_cancelled = False


class GripperResult(NamedTuple):
    """How a command ended."""

    state: GripperState
    succeeded: bool


class GripperClient:
    """Each command carries ``effort``, the gripper's own limit: it is safe also when this process ends.

    ``law``: opening by the gripper's position. ``timeout`` [s]: for its answer to a command. ``steady``: the clock.
    """

    def __init__(self, node: Node, interface: GripperInterface, action: str, law: LinearGap, *, effort: float,
                 timeout: float, steady: Callable[[], float]):
        self._steady = steady
        self._interface, self._law, self._effort, self._timeout = interface, law, effort, timeout
        self._client = ActionClient(node, interface.action, action)
        self._latest: _Sent | None = None
        self._open: list[_Sent] = []  # that may still move the gripper: neither rejected nor ended
        self._state, self._stated = GripperState(), -math.inf

    def destroy(self) -> None:
        self._client.destroy()

    def opening(self, max_age: float) -> float:
        """Return where the gripper said that it is [m], in feedback: results may be empty. NaN: not known, too old."""
        is_current = self._steady() - self._stated <= max_age
        return self._law.gap(self._state.position) if is_current else math.nan

    @property
    def result(self) -> GripperResult | None:
        """How the latest command ended; None: it has not."""
        return self._latest.result if self._latest else None

    @property
    def is_stopped(self) -> bool:
        """Whether nothing moves by a command of ours, as far as the gripper has confirmed it."""
        hold = self._open[0] if len(self._open) == 1 else None  # those before it have ended
        return not self._open or (hold is not None and hold.holds and hold.handle is not None)

    @property
    def is_hold_refused(self) -> bool:
        """Whether the gripper rejected the goal that was to stop it."""
        return self._latest is not None and self._latest.holds and self._latest.failure is Outcome.GRIPPER_REFUSED

    @property
    def is_there(self) -> bool:
        """False if the graph shows no server; True proves nothing."""
        return self._client.server_is_ready()

    def failure(self, now: float) -> Outcome | None:
        """Return why the latest command cannot be relied on at ``now`` [s]."""
        sent = self._latest
        if sent is None or sent.result is not None:
            return None
        if sent.failure is None and not self.is_there:
            sent.failure = Outcome.NO_GRIPPER
        elif sent.failure is None and sent.handle is None and now - sent.at > self._timeout:
            sent.failure = Outcome.GRIPPER_SILENT
        return sent.failure

    def drive(self, opening: float, speed: float, *, holds: bool = False) -> None:
        """Send the gripper to ``opening`` [m] at ``speed`` [m/s]; 0: at its own."""
        sent = self._latest = _Sent(holds, self._steady())
        self._open.append(sent)
        command = Command(self._law.reading(opening), abs(speed / self._law.scale), self._effort)
        future = self._client.send_goal_async(self._interface.goal(command),
                                              lambda message: self._take(message.feedback))
        future.add_done_callback(lambda done: self._on_answer(sent, done))

    def stop(self, opening: float = math.nan) -> None:
        """Have it hold at ``opening`` [m], where it is; NaN: by a cancel.

        All that may move it is cancelled: not every gripper ends a command when it accepts the next.
        """
        if math.isfinite(opening):
            self.drive(opening, 0.0, holds=True)
            return
        for sent in self._open:
            sent.is_cancelled = True  # as soon as the gripper accepts it
            if sent.handle is not None:
                sent.handle.cancel_goal_async()

    def _on_answer(self, sent: _Sent, future: Any) -> None:
        handle = future.result()
        if not handle.accepted:
            sent.failure = Outcome.GRIPPER_REFUSED
            self._open.remove(sent)
            return
        sent.handle = handle
        if sent.is_cancelled:
            handle.cancel_goal_async()
        handle.get_result_async().add_done_callback(lambda done: self._on_result(sent, done))

    def _on_result(self, sent: _Sent, future: Any) -> None:
        answer = future.result()
        sent.result = GripperResult(self._interface.state(answer.result), answer.status == GoalStatus.STATUS_SUCCEEDED)
        self._open.remove(sent)

    def _take(self, feedback: Any) -> None:
        state = self._interface.state(feedback)
        if math.isfinite(state.position):
            self._state, self._stated = state, self._steady()
