"""Command the gripper through its own action, one command at a time, and know which commands may still move it.

The rules trust only the gripper's responses, not the number of servers in the ROS graph, because the graph lists a
killed server for another 20 s, even next to a new server. The rules give up on a command that gets no response. Later
goals do not wait for this command, but the rules cannot know whether the gripper is still carrying it out.
"""

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol

from tactile_node.gripper.rules.closing import SILENCES, Outcome

#: Maximum number of unanswered commands that are remembered and cancelled before a goal closes the gripper.
MOST_GIVEN_UP = 10


class GripperResult(NamedTuple):
    """The result that the gripper sent for a command."""

    reached_goal: bool
    stalled: bool
    succeeded: bool  #: True if the action ended with the status SUCCEEDED

    @property
    def says_reached(self) -> bool:
        """True if the gripper reports that it is at the commanded opening.

        Not every gripper sets ``reached_goal``, so success without a stall counts as well.
        """
        return self.reached_goal or (self.succeeded and not self.stalled)


class SentGoal(Protocol):
    """A goal of the gripper's own action, which can be cancelled even before the gripper accepts it."""

    def cancel(self) -> None:
        """Send a new request to cancel the goal. Responses to earlier requests no longer count."""

    def repeat_cancel(self) -> None:
        """Send the request again if it has not been answered."""


class GripperAction(Protocol):
    """The gripper's own action."""

    @property
    def is_there(self) -> bool:
        """False if the ROS graph shows no action server. True does not prove that a server exists."""

    def send(self, opening: float, speed: float, command: 'Command', commands: 'Commands') -> SentGoal:
        """Send a goal, and pass the gripper's responses to the methods of ``commands`` whose names begin with on."""


class Command:
    """A command that was sent to the gripper."""

    goal: SentGoal

    def __init__(self, opening: float, holds: bool, at: float):
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

        # True if the answering server does not know the command, because the server that accepted it is gone or
        # suspended.
        self.is_unknown = False
        self.is_given_up = False  # True if the rules no longer wait for the command

    def cancel(self) -> None:
        self.is_ending = None
        self.goal.cancel()


class Commands:
    """The commands that were sent to the gripper's own action.

    Parameters
    ----------
    action : GripperAction
        The gripper's own action.
    timeout : float
        Time allowed for the response to a command [s].
    steady : callable
        Steady clock [s].
    stay : callable
        Function that returns the opening at which to hold the gripper [m], or NaN if the gripper stops when its action
        is cancelled.
    """

    def __init__(self, action: GripperAction, timeout: float, steady: Callable[[], float], stay: Callable[[], float]):
        self._action, self._timeout, self._steady, self._stay = action, timeout, steady, stay
        self._latest: Command | None = None
        self._open: list[Command] = []  # commands neither rejected nor ended, so they may still move the gripper
        self._opening, self._stated = math.nan, -math.inf

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
        return self._opening if self._steady() - self._stated <= max_age else math.nan

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

    def _doubts(self, command: Command) -> bool:
        return command.is_given_up or command.is_unknown or self._is_overdue(command)

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
        latest = self._latest
        return latest is not None and (latest.is_unknown or latest.is_ending is False if by_cancel else
                                       latest.holds and latest.failure is Outcome.GRIPPER_REFUSED)

    def give_up(self) -> None:
        """Stop waiting for all open commands. An open command that is accepted later is cancelled."""
        for command in self._open:
            command.is_given_up = command.is_cancelled = True
        del self._open[:-MOST_GIVEN_UP]  # a deleted command is still cancelled if it is accepted later

    def clear(self) -> None:
        """Cancel each open command by its goal ID, even if it has not been accepted yet."""
        for command in self._open:
            command.is_cancelled = True
            command.cancel()

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
        latest = self._latest
        if latest is None or latest.result is not None:
            return None
        if self._action.is_there:  # is_there is also False briefly while another server starts
            latest.served = self._steady()
        if latest.failure is None and self._steady() - latest.served > self._timeout:
            latest.failure = Outcome.NO_GRIPPER
            if not latest.is_accepted and latest.served == latest.at:  # no server can have received the command
                latest.is_cancelled = True
                self._end(latest)
        elif latest.failure is None and self._is_overdue(latest):
            latest.failure = Outcome.GRIPPER_SILENT
        return latest.failure

    def _is_overdue(self, command: Command) -> bool:
        return not command.is_accepted and self._steady() - command.at > self._timeout

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
        command = self._latest = Command(opening, holds, self._steady())
        self._open.append(command)
        command.goal = self._action.send(opening, speed, command, self)

    def stop(self, opening: float = math.nan) -> None:
        """Stop the gripper.

        The rules cancel every open command, because not every gripper ends a command when it accepts the next one.

        Parameters
        ----------
        opening : float
            Current opening, at which a command then holds the gripper [m]; NaN to stop the gripper by a cancel instead.
        """
        if math.isfinite(opening):
            self.drive(opening, 0.0, holds=True)
            return
        for command in self._open:
            command.is_cancelled = True
            if command.is_accepted:  # this cancel names the goal, so that later goals continue
                command.cancel()

    def repeat_cancels(self) -> None:
        """Send each unanswered cancel request again.

        Fast DDS sends nothing to a suspended process. When the process resumes, it receives the missed requests
        together with the next request. Without a further request, it would receive them up to 3 s later, and a closing
        gripper would meanwhile continue to close.
        """
        for command in self._open if self._action.is_there else ():
            command.goal.repeat_cancel()

    def on_feedback(self, opening: float) -> None:
        """Store an opening that the gripper reports [m]."""
        if math.isfinite(opening):
            self._opening, self._stated = opening, self._steady()

    def on_accepted(self, command: Command) -> None:
        is_late = self._is_overdue(command)
        command.is_accepted = True
        if command not in self._open:
            self._open.append(command)  # this forgotten command may move the gripper after all
        if command.is_cancelled or is_late:
            command.cancel()
            if command is self._latest and math.isfinite(opening := self._stay()):
                self.drive(opening, 0.0, holds=True)

    def on_rejected(self, command: Command) -> None:
        command.failure = Outcome.GRIPPER_REFUSED
        self._end(command)
        command.cancel()  # another server may have accepted the command, or may accept it when the server resumes

    def on_cancelled(self, command: Command, *, is_ending: bool, is_unknown: bool) -> None:
        """Store the response to a cancel request.

        ``is_ending`` is True if the command ends or has ended, and ``is_unknown`` if the server does not know it.
        """
        command.is_unknown |= command.is_accepted and is_unknown
        command.is_ending = is_ending

    def on_result(self, command: Command, result: GripperResult) -> None:
        command.result = result
        self._end(command)

    def on_lost_result(self, command: Command) -> None:
        """Record that another server answered the request for the result, and does not know the command."""
        command.is_unknown, command.failure = True, Outcome.GRIPPER_SILENT

    def _end(self, command: Command) -> None:
        if command in self._open:
            self._open.remove(command)
