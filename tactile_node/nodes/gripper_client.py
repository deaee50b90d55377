"""Commands the gripper's own action, one command at a time; what it says of itself.

The number of servers in the graph decides nothing, because a killed server stays there for 20 s, also beside a new one.
The answers decide. The client gives up a command that gets no answer: it holds up no later goal, but leaves a doubt.
"""

import math
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple
from uuid import uuid4

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from unique_identifier_msgs.msg import UUID

from tactile_node.grasp.closing import Outcome
from tactile_node.grasp.opening import LinearGap
from tactile_node.ros.gripper_messages import Command, GripperInterface, GripperState

SILENCES = Outcome.NO_GRIPPER, Outcome.GRIPPER_SILENT
CANCEL_PERIOD = 0.2  #: s after which a cancel without an answer is sent again
MOST_CANCELS = 10  #: without an answer, of one command: of more the middleware keeps none
MOST_GIVEN_UP = 10  #: commands without an answer that are still cancelled before a goal closes


class _Sent:
    """One command on its way."""

    def __init__(self, handle: ClientGoalHandle, opening: float, holds: bool, at: float):
        self.handle = handle           # cancels it, also before it is accepted
        self.opening = opening         # to which it sends the gripper [m]
        self.holds = holds             # it stops the gripper where it is
        self.at = self.served = at     # when it was sent, and when the graph last showed a whole server [s]
        self.is_accepted = False
        self.failure: Outcome | None = None
        self.result: GripperResult | None = None
        self.is_cancelled = False      # as soon as it is accepted
        self.is_ending: bool | None = None  # False: it refused the latest cancel; None: no answer
        self.cancels: deque[Any] = deque()  # futures of that cancel, which was sent again and again
        self.is_unknown = False        # to the server that answers: the one that accepted it is gone, or stopped
        self.is_given_up = False       # it got no answer in time


class GripperResult(NamedTuple):
    """How a command ended."""

    state: GripperState
    succeeded: bool

    @property
    def says_reached(self) -> bool:
        """True if the gripper says that it is where it was sent. Not every gripper sets ``reached_goal``."""
        return self.state.reached_goal or (self.succeeded and not self.state.stalled)


class GripperClient:
    """Each command carries ``effort``, the gripper's own limit: it is safe also when this process ends.

    ``law``: opening by the gripper's position. ``timeout`` [s]: for its answer to a command. ``steady``: the clock.
    ``stay``: returns where a goal is to hold a gripper that goes on when it is cancelled [m]; NaN: a cancel stops it.
    """

    def __init__(self, node: Node, interface: GripperInterface, action: str, law: LinearGap, *, effort: float,
                 timeout: float, steady: Callable[[], float], stay: Callable[[], float]):
        self._steady, self._stay = steady, stay
        self._interface, self._law, self._effort, self._timeout = interface, law, effort, timeout
        self._client = ActionClient(node, interface.action, action)
        self._repeats = node.create_timer(CANCEL_PERIOD, self._repeat_cancels,
                                          clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._latest: _Sent | None = None
        self._open: list[_Sent] = []  # may still move the gripper: neither rejected nor ended
        self._state, self._stated = GripperState(), -math.inf

    def destroy(self) -> None:
        self._repeats.cancel()
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
        """True if every command known to a server that answers has ended, or only a confirmed hold is open."""
        moving = [each for each in self._open if not (each.is_given_up if each is self._latest else self._doubts(each))]
        return not moving or (len(moving) == 1 and moving[0].holds and moving[0].is_accepted)

    @property
    def farthest(self) -> float:
        """Widest opening to which a command that has not ended sends the gripper [m]; -inf: there is none."""
        return max((each.opening for each in self._open), default=-math.inf)

    @property
    def is_doubtful(self) -> bool:
        """True if the gripper may still carry out a command whose server is gone, or stopped and may wake up."""
        return any(map(self._doubts, self._open))

    def _doubts(self, sent: _Sent) -> bool:
        return sent.is_given_up or sent.is_unknown or self._is_overdue(sent)

    @property
    def is_there(self) -> bool:
        """False if the graph shows no server; True proves nothing."""
        return self._client.server_is_ready()

    @property
    def is_silent(self) -> bool:
        """True if the latest command was not answered: a goal to hold would not be either."""
        return self._latest is not None and not self._latest.is_accepted and self._latest.failure in SILENCES

    def is_stop_vain(self, by_cancel: bool) -> bool:
        """Return True if the gripper refused the cancel or does not know the command, or rejected the goal to hold."""
        sent = self._latest
        return sent is not None and (sent.is_unknown or sent.is_ending is False if by_cancel else
                                     sent.holds and sent.failure is Outcome.GRIPPER_REFUSED)

    def give_up(self) -> None:
        """Rely on no open command any more."""
        for sent in self._open:
            sent.is_given_up = sent.is_cancelled = True
        del self._open[:-MOST_GIVEN_UP]  # one that is accepted later is cancelled at once all the same

    def clear(self) -> None:
        """Cancel each open command by its id, whether it is accepted or not."""
        for sent in self._open:
            sent.is_cancelled = True
            self._cancel(sent)

    def clearing(self) -> tuple[bool, bool]:
        """Return whether the gripper has answered the cancel of each open command, and whether it confirmed each."""
        endings = [each.is_ending for each in self._open if self._doubts(each) or not each.holds]
        return None not in endings, all(endings)

    def forget(self) -> None:
        """Forget the doubtful commands. One that is accepted later is cancelled at once all the same."""
        self._open = [each for each in self._open if not self._doubts(each)]

    def failure(self) -> Outcome | None:
        """Return why the latest command cannot be relied on."""
        sent = self._latest
        if sent is None or sent.result is not None:
            return None
        if self.is_there:  # False for a moment, too, while another server starts
            sent.served = self._steady()
        if sent.failure is None and self._steady() - sent.served > self._timeout:
            sent.failure = Outcome.NO_GRIPPER
            if not sent.is_accepted and sent.served == sent.at:  # nothing heard it
                sent.is_cancelled = True
                self._end(sent)
        elif sent.failure is None and self._is_overdue(sent):
            sent.failure = Outcome.GRIPPER_SILENT
        return sent.failure

    def _is_overdue(self, sent: _Sent) -> bool:
        return not sent.is_accepted and self._steady() - sent.at > self._timeout

    def drive(self, opening: float, speed: float, *, holds: bool = False) -> None:
        """Send the gripper to ``opening`` [m] at ``speed`` [m/s]; 0: at its own."""
        goal_id = UUID(uuid=list(uuid4().bytes))
        sent = self._latest = _Sent(ClientGoalHandle(self._client, goal_id, None), opening, holds, self._steady())
        self._open.append(sent)
        command = Command(self._law.reading(opening), abs(speed / self._law.scale), self._effort)
        future = self._client.send_goal_async(self._interface.goal(command),
                                              lambda message: self._take(message.feedback), goal_id)
        future.add_done_callback(lambda done: self._on_answer(sent, done))

    def stop(self, opening: float = math.nan) -> None:
        """Have it hold at ``opening`` [m], where it is; NaN: by a cancel.

        All that may move it is cancelled: not every gripper ends a command when it accepts the next.
        """
        if math.isfinite(opening):
            self.drive(opening, 0.0, holds=True)
            return
        for sent in self._open:
            sent.is_cancelled = True
            if sent.is_accepted:  # by its id, so that a later goal goes on
                self._cancel(sent)

    def _cancel(self, sent: _Sent) -> None:
        sent.is_ending = None
        while sent.cancels:
            sent.cancels.popleft().cancel()  # rclpy keeps a request without an answer for ever
        self._send_cancel(sent)

    def _repeat_cancels(self) -> None:
        """Send each cancel without an answer again.

        Fast DDS sends a stopped process nothing. After it wakes up, the process gets what it missed with the next
        request, or else within 3 s, and meanwhile a gripper that was closing closes on.
        """
        for sent in self._open if self.is_there else ():
            if sent.cancels:
                self._send_cancel(sent)

    def _send_cancel(self, sent: _Sent) -> None:
        if len(sent.cancels) == MOST_CANCELS:
            sent.cancels.popleft().cancel()
        future = sent.handle.cancel_goal_async()
        sent.cancels.append(future)
        future.add_done_callback(lambda done: self._on_cancelled(sent, done))

    def _on_cancelled(self, sent: _Sent, future: Any) -> None:
        if future.cancelled() or future not in sent.cancels:  # one that was sent again has been answered
            return
        sent.cancels.clear()
        answer = future.result()
        sent.is_unknown |= sent.is_accepted and answer.return_code == answer.ERROR_UNKNOWN_GOAL_ID
        is_gone = answer.return_code in (answer.ERROR_UNKNOWN_GOAL_ID, answer.ERROR_GOAL_TERMINATED)
        sent.is_ending = is_gone or bool(answer.goals_canceling)

    def _on_answer(self, sent: _Sent, future: Any) -> None:
        handle = future.result()
        if not handle.accepted:
            sent.failure = Outcome.GRIPPER_REFUSED
            self._end(sent)
            self._cancel(sent)  # another server may have accepted it, or does so when it wakes up
            return
        is_late = self._is_overdue(sent)
        sent.handle, sent.is_accepted = handle, True
        if sent not in self._open:
            self._open.append(sent)  # forgotten; now it moves the gripper
        if sent.is_cancelled or is_late:
            self._cancel(sent)
            if sent is self._latest and math.isfinite(opening := self._stay()):
                self.drive(opening, 0.0, holds=True)
        handle.get_result_async().add_done_callback(lambda done: self._on_result(sent, done.result()))

    def _on_result(self, sent: _Sent, answer: Any) -> None:
        if answer.status == GoalStatus.STATUS_UNKNOWN:  # another server answered
            sent.is_unknown, sent.failure = True, Outcome.GRIPPER_SILENT
            return
        sent.result = GripperResult(self._interface.state(answer.result), answer.status == GoalStatus.STATUS_SUCCEEDED)
        self._end(sent)

    def _end(self, sent: _Sent) -> None:
        if sent in self._open:
            self._open.remove(sent)

    def _take(self, feedback: Any) -> None:
        state = self._interface.state(feedback)
        if math.isfinite(state.position):
            self._state, self._stated = state, self._steady()
