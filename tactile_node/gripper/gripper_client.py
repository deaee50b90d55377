"""Command the gripper through its own action, one command at a time, and read its state.

The client trusts only the gripper's responses, not the number of servers in the ROS graph, because the graph lists a
killed server for another 20 s, even next to a new server. The client gives up on a command that gets no response. Later
goals do not wait for this command, but the client cannot know whether the gripper is still carrying it out.
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

from tactile_node.grasp.opening import LinearGap
from tactile_node.gripper.messages import Command, GripperInterface, GripperState
from tactile_node.gripper.rules.closing import Outcome

SILENCES = Outcome.NO_GRIPPER, Outcome.GRIPPER_SILENT  #: Outcomes of a command that got no response.
CANCEL_PERIOD = 0.2  #: Time after which an unanswered cancel request is sent again [s].
#: Maximum number of unanswered cancel requests for one command. The middleware does not queue more requests.
MOST_CANCELS = 10
#: Maximum number of unanswered commands that the client remembers and cancels before a goal closes the gripper.
MOST_GIVEN_UP = 10


class _Sent:
    """A command that was sent to the gripper."""

    def __init__(self, handle: ClientGoalHandle, opening: float, holds: bool, at: float):
        self.handle = handle  # handle that can cancel the command even before the gripper accepts it
        self.opening = opening  # commanded opening [m]
        self.holds = holds  # True if the command holds the gripper at its current opening
        self.at = at  # time when the command was sent [s]
        self.served = at  # time when the ROS graph last showed a complete action server [s]
        self.is_accepted = False
        self.failure: Outcome | None = None
        self.result: GripperResult | None = None
        self.is_cancelled = False  # True if the command must be cancelled as soon as it is accepted

        # True if the gripper confirmed the latest cancel, False if it refused; None before its response
        self.is_ending: bool | None = None
        self.cancels: deque[Any] = deque()  # futures of the cancel requests, which are repeated until answered

        # True if the answering server does not know the command, because the server that accepted it is gone or
        # suspended.
        self.is_unknown = False
        self.is_given_up = False  # True if the client no longer waits for the command


class GripperResult(NamedTuple):
    """The result that the gripper sent for a command."""

    state: GripperState
    succeeded: bool  #: True if the action ended with the status SUCCEEDED

    @property
    def says_reached(self) -> bool:
        """True if the gripper reports that it is at the commanded opening.

        Not every gripper sets ``reached_goal``, so success without a stall counts as well.
        """
        return self.state.reached_goal or (self.succeeded and not self.state.stalled)


class GripperClient:
    """Client of the gripper's own action.

    Each command carries an effort limit, so the gripper stays within that limit even if this process ends.

    Parameters
    ----------
    node : Node
        Node that sends the commands.
    interface : GripperInterface
        Type of the gripper's action.
    action : str
        Name of the gripper's action.
    law : LinearGap
        Relation between the position that the gripper reports and its opening.
    effort : float
        Effort limit sent with each command, in the unit of the gripper.
    timeout : float
        Time allowed for the response to a command [s].
    steady : callable
        Steady clock [s].
    stay : callable
        Function that returns the opening at which to hold the gripper [m], or NaN if the gripper stops when its action
        is cancelled.
    """

    def __init__(self, node: Node, interface: GripperInterface, action: str, law: LinearGap, *, effort: float,
                 timeout: float, steady: Callable[[], float], stay: Callable[[], float]):
        self._steady, self._stay = steady, stay
        self._interface, self._law, self._effort, self._timeout = interface, law, effort, timeout
        self._client = ActionClient(node, interface.action, action)
        self._repeats = node.create_timer(CANCEL_PERIOD, self._repeat_cancels,
                                          clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._latest: _Sent | None = None
        self._open: list[_Sent] = []  # commands neither rejected nor ended, so they may still move the gripper
        self._state, self._stated = GripperState(), -math.inf

    def destroy(self) -> None:
        """Destroy the action client. Commands that were already sent continue."""
        self._repeats.cancel()
        self._client.destroy()

    def opening(self, max_age: float) -> float:
        """Return the opening that the gripper last reported in feedback [m].

        Results are ignored, because they may be empty.

        Parameters
        ----------
        max_age : float
            Age above which the reported opening counts as too old [s].

        Returns
        -------
        float
            Opening [m]; NaN if the gripper has not reported an opening, or if the report is too old.
        """
        is_current = self._steady() - self._stated <= max_age
        return self._law.gap(self._state.position) if is_current else math.nan

    @property
    def result(self) -> GripperResult | None:
        """Result of the latest command, or None if that command has not ended."""
        return self._latest.result if self._latest else None

    @property
    def is_stopped(self) -> bool:
        """True if all commands have ended, not counting an accepted hold and doubtful earlier commands."""
        moving = [each for each in self._open if not (each.is_given_up if each is self._latest else self._doubts(each))]
        return not moving or (len(moving) == 1 and moving[0].holds and moving[0].is_accepted)

    @property
    def farthest(self) -> float:
        """Widest opening among the commands that have not ended [m]; -inf if all commands have ended."""
        return max((each.opening for each in self._open), default=-math.inf)

    @property
    def is_doubtful(self) -> bool:
        """True if the gripper may still carry out a command whose server is gone, or is suspended and may resume."""
        return any(map(self._doubts, self._open))

    def _doubts(self, sent: _Sent) -> bool:
        return sent.is_given_up or sent.is_unknown or self._is_overdue(sent)

    @property
    def is_there(self) -> bool:
        """False if the ROS graph shows no action server. True does not prove that a server exists."""
        return self._client.server_is_ready()

    @property
    def is_silent(self) -> bool:
        """True if the latest command got no response. A command to hold would then get no response either."""
        return self._latest is not None and not self._latest.is_accepted and self._latest.failure in SILENCES

    def is_stop_vain(self, by_cancel: bool) -> bool:
        """Return True if an attempt to stop the gripper has failed.

        A cancel fails if the gripper refuses the cancel or does not know the command. A command to hold fails if the
        gripper rejects it.

        Parameters
        ----------
        by_cancel : bool
            True if the attempt was a cancel, False if it was a command to hold.
        """
        sent = self._latest
        return sent is not None and (sent.is_unknown or sent.is_ending is False if by_cancel else
                                     sent.holds and sent.failure is Outcome.GRIPPER_REFUSED)

    def give_up(self) -> None:
        """Stop waiting for all open commands. An open command that is accepted later is cancelled."""
        for sent in self._open:
            sent.is_given_up = sent.is_cancelled = True
        del self._open[:-MOST_GIVEN_UP]  # a deleted command is still cancelled if it is accepted later

    def clear(self) -> None:
        """Cancel each open command by its goal ID, even if it has not been accepted yet."""
        for sent in self._open:
            sent.is_cancelled = True
            self._cancel(sent)

    def clearing(self) -> tuple[bool, bool]:
        """Return how far ``clear`` has progressed.

        Returns
        -------
        tuple of two bool
            First, True if the gripper has answered the cancel of every open command. Second, True if the gripper has
            confirmed every cancel.
        """
        endings = [each.is_ending for each in self._open if self._doubts(each) or not each.holds]
        return None not in endings, all(endings)

    def forget(self) -> None:
        """Forget all doubtful commands. A forgotten command is still cancelled if the gripper accepts it later."""
        self._open = [each for each in self._open if not self._doubts(each)]

    def failure(self) -> Outcome | None:
        """Return the reason why the latest command has failed, or None."""
        sent = self._latest
        if sent is None or sent.result is not None:
            return None
        if self.is_there:  # is_there is also False briefly while another server starts
            sent.served = self._steady()
        if sent.failure is None and self._steady() - sent.served > self._timeout:
            sent.failure = Outcome.NO_GRIPPER
            if not sent.is_accepted and sent.served == sent.at:  # no server can have received the command
                sent.is_cancelled = True
                self._end(sent)
        elif sent.failure is None and self._is_overdue(sent):
            sent.failure = Outcome.GRIPPER_SILENT
        return sent.failure

    def _is_overdue(self, sent: _Sent) -> bool:
        return not sent.is_accepted and self._steady() - sent.at > self._timeout

    def drive(self, opening: float, speed: float, *, holds: bool = False) -> None:
        """Command the gripper to an opening.

        Parameters
        ----------
        opening : float
            Commanded opening [m].
        speed : float
            Commanded speed [m/s]; 0 selects the gripper's own speed.
        holds : bool
            True if the command holds the gripper at its current opening.
        """
        goal_id = UUID(uuid=list(uuid4().bytes))
        sent = self._latest = _Sent(ClientGoalHandle(self._client, goal_id, None), opening, holds, self._steady())
        self._open.append(sent)
        command = Command(self._law.reading(opening), abs(speed / self._law.scale), self._effort)
        future = self._client.send_goal_async(self._interface.goal(command),
                                              lambda message: self._take(message.feedback), goal_id)
        future.add_done_callback(lambda done: self._on_answer(sent, done))

    def stop(self, opening: float = math.nan) -> None:
        """Stop the gripper.

        The client cancels every open command, because not every gripper ends a command when it accepts the next one.

        Parameters
        ----------
        opening : float
            Current opening, at which a command then holds the gripper [m]; NaN to stop the gripper by a cancel instead.
        """
        if math.isfinite(opening):
            self.drive(opening, 0.0, holds=True)
            return
        for sent in self._open:
            sent.is_cancelled = True
            if sent.is_accepted:  # this cancel names the goal, so that later goals continue
                self._cancel(sent)

    def _cancel(self, sent: _Sent) -> None:
        sent.is_ending = None
        while sent.cancels:
            sent.cancels.popleft().cancel()  # otherwise, rclpy never discards an unanswered request
        self._send_cancel(sent)

    def _repeat_cancels(self) -> None:
        """Send each unanswered cancel request again.

        Fast DDS sends nothing to a suspended process. When the process resumes, it receives the missed requests
        together with the next request. Without a further request, it would receive them up to 3 s later, and a closing
        gripper would meanwhile continue to close.
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
        if future.cancelled() or future not in sent.cancels:  # an earlier request for this cancel was answered
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
            self._cancel(sent)  # another server may have accepted the command, or may accept it when the server resumes
            return
        is_late = self._is_overdue(sent)
        sent.handle, sent.is_accepted = handle, True
        if sent not in self._open:
            self._open.append(sent)  # this forgotten command may move the gripper after all
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
