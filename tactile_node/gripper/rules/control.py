"""Carry out the goals of the gripper node one after the other, and decide when and why each goal ends."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from tactile_node.errors import RefusedGoalError
from tactile_node.grasp.opening import HIGHEST_GAP
from tactile_node.grasp.tracker import GraspContact
from tactile_node.gripper.rules.closing import (
    BEYOND,
    NO_TOUCH,
    SILENCES,
    SUCCESSES,
    TOLD_IN_DOUBT,
    Clearing,
    Closing,
    ForceReading,
    Goal,
    Outcome,
    Rest,
    Widening,
    check_number,
    make_goal,
)
from tactile_node.gripper.rules.commands import Commands, GripperAction, GripperResult
from tactile_node.gripper.rules.holding import Holding
from tactile_node.gripper.rules.touch_settings import TouchSettings

LEAST_EXCESS = 0.05  #: If the force exceeds the goal's force by at least this much, the outcome's message says so [N].
NEAR = 0.002  #: Largest distance from the commanded opening at which the gripper counts as being there [m].
ROUNDING = 1e-6  #: Rounding error of an opening that is converted from the gripper's own unit [m].
IN_DOUBT = 'the gripper may still be moving, because it did not confirm the end of an earlier command'
NOT_ENDING = ('the gripper refuses to cancel an earlier command, and no measurement shows it at rest: provide its '
              'measured opening, or restart its driver')


class Duplicates(Protocol):
    """Other processes that command the same gripper."""

    @property
    def text(self) -> str:
        """Error text if another process was heard, otherwise ''."""

    @property
    def has_listened(self) -> bool:
        """True if this process has listened for long enough."""


class Wish(NamedTuple):
    """The request in a client's goal. A speed or a force is 0 if the goal gives none."""

    opening: float  #: [m]
    speed: float = 0.0  #: [m/s]
    force: float = 0.0  #: [N]


class Ending(NamedTuple):
    """How a goal, or the hold after a goal, has ended."""

    outcome: Outcome
    is_hold: bool  #: True if the hold after the goal has ended
    succeeds: bool  #: True if the goal has succeeded
    reasons: tuple[str, ...]  #: explanations of the outcome
    opening: float  #: [m], or NaN if unknown
    pads: tuple[ForceReading, ForceReading]  #: forces that the pads read now

    @property
    def text(self) -> str:
        """Outcome with its explanations."""
        return f'{self.outcome.name}: {"; ".join(self.reasons)}' if self.reasons else self.outcome.name

    @property
    def is_usual(self) -> bool:
        """True for a success, and for a hold that a new goal has replaced. All other outcomes are logged."""
        return self.outcome in SUCCESSES or (self.is_hold and self.outcome is Outcome.REPLACED)


@dataclass
class _Run:
    """A goal that is being carried out, or the hold that follows a goal.

    `TouchControl.look` moves a run from one state to the next:

    | state | condition | the gripper |
    | --- | --- | --- |
    | waiting | ``waits`` | is stopped |
    | moving | the task gives a speed | is driven to the target of the task |
    | resting | the task gives no speed | is stopped, and may be driven again |
    | ending | ``outcome`` is known | is stopped by one method, then by the other |
    | ended | it has stopped, or both methods failed | is left alone; a hold may follow |
    """

    handle: Any  #: the client's goal, with the property ``is_cancel_requested``
    wish: Wish

    #: task of the goal; `Holding` after the result of the goal was sent, None for a refused goal
    task: Widening | Closing | Holding | None = None
    #: True while the goal waits for the end of the listening for duplicates, or for an earlier command to end
    waits: bool = True
    clearing: Clearing | None = None  #: checks whether earlier commands have ended while the goal waits for them
    speed: float = 0.0  #: commanded speed [m/s]; 0 before the first command and after a stop

    #: detects when the gripper is at rest although its reported and measured openings differ
    rest: Rest | None = None
    outcome: Outcome | None = None  #: outcome of the goal, or None while the goal is running
    reason: str = ''  #: text that explains the outcome to the client
    by_cancel: bool = True  #: True if a cancel is stopping the gripper, False if a command to hold is stopping it
    stop_since: float = math.inf  #: time of the command to stop [s]

    @property
    def target(self) -> float:
        """Opening to which the goal or the hold moves the gripper [m]; NaN for a refused goal."""
        return self.task.target if self.task else math.nan

    @property
    def opens(self) -> bool:
        """True if the goal opens the gripper."""
        return isinstance(self.task, Widening)

    @property
    def is_hold(self) -> bool:
        """True if this is the hold after a goal."""
        return isinstance(self.task, Holding)

    @property
    def goal(self) -> Goal | None:
        """The client's goal if it closes the gripper, otherwise None."""
        return self.task.goal if isinstance(self.task, Closing) else None


class TouchControl:
    """Carries out one goal at a time. A new goal replaces the previous goal.

    The gripper continues to close only while the readings of the pads allow it.

    Parameters
    ----------
    settings : TouchSettings
        Settings of the rules.
    action : GripperAction
        The gripper's own action.
    duplicates : Duplicates
        Other processes that command the same gripper.
    on_end : callable
        Function that is called with the client's handle when its goal, or the hold after the goal, has ended.
    why_unseen : callable
        Function that returns the reason why the pads are not seen, as text.
    commands_speed : bool
        True if the gripper accepts a speed.
    steady : callable
        Steady clock [s].

    Attributes
    ----------
    commands : Commands
        Commands that were sent to the gripper.
    touch : TouchReading
        Latest readings of the pads.
    last : Outcome or None
        Outcome of the latest goal or hold.
    suspends_hold : bool
        True while no hold may begin a correction, because it would look like a touch of the held object.
    """

    def __init__(self, settings: TouchSettings, action: GripperAction, duplicates: Duplicates,
                 on_end: Callable[[Any, Ending], None], *, why_unseen: Callable[[], str],
                 commands_speed: bool, steady: Callable[[], float]):
        self._settings, self._duplicates, self._steady = settings, duplicates, steady
        self._on_end, self._why_unseen, self._commands_speed = on_end, why_unseen, commands_speed
        self._cancels = settings.stop_by == 'cancel'
        self.commands = Commands(action, settings.answer_timeout, steady,
                                 stay=lambda: math.nan if self._cancels else self.opening)
        self.touch = NO_TOUCH
        self.last: Outcome | None = None
        self.suspends_hold = False
        self._run: _Run | None = None
        self._gap = math.nan  # last measured opening [m]
        self._gap_measured = -math.inf  # time of the last measured opening [s]

    @property
    def work(self) -> str:
        """Current activity: 'none', 'goal' or 'hold'."""
        return 'none' if self._run is None else 'hold' if self._run.is_hold else 'goal'

    @property
    def is_resting(self) -> bool:
        """True if neither a goal nor a correction of the hold moves the gripper."""
        return self._run is None or (self._run.is_hold and not self._run.speed)

    @property
    def goal_handle(self) -> Any:
        """Handle of the goal that is being carried out, or None."""
        run = self._run
        return run.handle if run is not None and run.outcome is None and not run.is_hold else None

    @property
    def opening(self) -> float:
        """Measured opening [m], or NaN if the current opening is not known."""
        is_current = self._steady() - self._gap_measured <= self._settings.max_age
        return self._gap if is_current else self.commands.opening(self._settings.max_age)

    @property
    def force(self) -> float:
        """Force on the more strongly pressed pad [N], or NaN if the current force is not known."""
        return self.touch.strongest if self.is_current else math.nan

    @property
    def is_current(self) -> bool:
        """True if both pads are currently seen."""
        return self.touch.is_current(self._steady(), self._settings.max_age)

    def measure(self, gap: float, measured: float) -> None:
        """Store an opening ``gap`` [m] that was measured at the time ``measured`` [s]."""
        self._gap, self._gap_measured = gap, measured

    def accept(self, handle: Any, wish: Wish) -> None:
        """Carry out a goal, or refuse it."""
        run = _Run(handle, wish)
        self._decide(run)
        if run.outcome is not None:
            self._finish(run)
            return
        if self._run is not None:
            self._run.outcome = Outcome.REPLACED
            self._finish(self._run)
        self._run = run
        self.look()

    def refuse(self, handle: Any, reason: str) -> None:
        """Refuse a goal that cannot be read."""
        self._finish(_Run(handle, Wish(math.nan), outcome=Outcome.REFUSED, reason=reason))

    def shut_down(self) -> None:
        """Stop a closing gripper, because nothing will monitor it any longer."""
        run, self._run = self._run, None
        if run is not None and not self._is_stopped(run):
            self._stop(run, self._cancels and not self._is_early(run))

    def look(self) -> None:
        """Continue, stop or end the current goal."""
        run = self._run
        if run is None:
            return
        if run.outcome is None:
            run.outcome = self._outcome(run)
            run.reason = self._reason(run.outcome) or run.reason
            if run.outcome is None and not run.waits and self._drives(run):
                return
            is_to_stop = run.outcome is not None or run.speed or run.stop_since == math.inf
            if not self._is_stopped(run) and is_to_stop:
                self._stop(run, (self._cancels or self._is_cancel_due(run)) and not self._is_early(run))
            run.speed = 0.0
        if self.commands.is_stopped:
            if run.outcome is not None:
                self._finish(run)
            return
        is_late = self._steady() - run.stop_since > self._settings.answer_timeout
        if is_late or self.commands.is_stop_vain(run.by_cancel):
            self._insist(run)

    def _decide(self, run: _Run) -> None:
        """Decide from the current opening whether the goal opens or closes the gripper, or refuse the goal."""
        now, present, (opening, speed, force) = self._steady(), self.opening, run.wish
        try:
            check_number('opening', opening, -BEYOND, HIGHEST_GAP, 'm')
            if self._opens(opening, present):
                run.task = Widening(opening, self._settings, now, present)
                return
            goal = make_goal(opening, speed, force, self._settings, speed_is_fixed=not self._commands_speed)
            run.task = Closing(goal, self._settings, now, present)
        except RefusedGoalError as error:
            run.outcome, run.reason = Outcome.REFUSED, str(error)

    def _opens(self, opening: float, present: float) -> bool:
        """Return True if a goal opens the gripper.

        ``opening`` is the commanded opening [m]; ``present`` is the measured opening [m], or NaN if it is not known.
        """
        if self._is_widest(opening):
            return not opening < present - NEAR
        before = self._run  # a gripper that is opening may be wider than last measured
        may_be_wider = self.commands.farthest > opening or (before is not None and before.opens and before.speed > 0)
        return opening >= present and not may_be_wider and not self.commands.is_doubtful

    def _opens_fully(self, run: _Run) -> bool:
        """Return True for a goal that fully opens the gripper. Such a goal is always forwarded."""
        return run.opens and self._is_widest(run.target)

    def _is_widest(self, opening: float) -> bool:
        return opening >= self._settings.widest - ROUNDING

    def _is_cancel_due(self, run: _Run) -> bool:
        """Return True if only a cancel can stop the gripper.

        A command to hold cannot help if the latest command got no response, or if that command opened the gripper and
        has ended.
        """
        return self.commands.is_silent or (run.opens and self.commands.result is not None)

    def _is_early(self, run: _Run) -> bool:
        """Return True if the gripper reports the commanded opening, but another opening is measured.

        In this case, the gripper may still be moving.
        """
        result = self.commands.result
        if not (run.speed and result is not None and result.says_reached):
            return False
        if run.opens:
            return self.opening < min(run.target, self._settings.widest) - NEAR
        return abs(self.opening - run.target) > NEAR

    def _is_stopped(self, run: _Run) -> bool:
        return self.commands.is_stopped and not self._is_early(run)

    def _outcome(self, run: _Run) -> Outcome | None:
        if not run.is_hold and run.handle.is_cancel_requested:
            return Outcome.CANCELED
        if self._duplicates.text and not self._opens_fully(run):
            return Outcome.DUPLICATE
        if run.waits:
            run.outcome = self._why_not_begin(run)
        if run.waits or run.outcome is not None or run.task is None:
            return run.outcome
        if not (run.opens or run.speed) and self.commands.is_doubtful:
            return Outcome.NOT_STOPPED
        failure = self.commands.failure() if run.speed else None
        if failure is not None:
            return failure
        if isinstance(run.task, Holding):
            run.task.is_suspended = self.suspends_hold
        stop = run.task.look(self._steady(), self.touch, self.opening, is_still=self._is_stopped(run))
        result = self.commands.result if run.speed else None
        if result is None or stop in SUCCESSES:
            return stop
        ending = self._ending(run, result, stop)
        has_eased = isinstance(run.task, Holding) and run.task.eases and ending is Outcome.REACHED
        return stop if has_eased else ending

    def _why_not_begin(self, run: _Run) -> Outcome | None:
        """Start a waiting goal as soon as possible. Return an outcome if the goal can never start, otherwise None."""
        if not self._opens_fully(run):
            if not self._duplicates.has_listened:
                return None
            if run.clearing is None and self.commands.is_doubtful:
                run.clearing = Clearing(self._steady(), self._settings.answer_timeout)
                self.commands.clear()
            if run.clearing is not None:
                is_answered, is_ended = self.commands.clearing()
                end = run.clearing.look(self._steady(), self.opening, is_answered=is_answered, is_ended=is_ended)
                if not run.clearing.is_over:
                    run.reason = NOT_ENDING if is_answered and not is_ended else ''
                    return end
                self.commands.forget()
        self._decide(run)  # a new decision, because the gripper may have moved in the meantime
        run.waits = False
        return run.outcome

    def _reason(self, outcome: Outcome | None) -> str:
        if outcome is Outcome.NOT_SEEN:
            return self._why_unseen()
        return self._duplicates.text if outcome is Outcome.DUPLICATE else ''

    def _ending(self, run: _Run, result: GripperResult, stop: Outcome | None) -> Outcome | None:
        """Return the outcome of a goal after the gripper has ended its command.

        While the gripper may still be moving, the method returns ``stop``, which is the outcome of the task or None.
        """
        if not result.says_reached:
            return Outcome.STALLED if result.stalled else stop or Outcome.GRIPPER_FAILED
        if not self._is_early(run):
            is_held_up = isinstance(run.task, Closing) and self.touch.is_touched and not result.reached_goal
            return Outcome.STALLED if is_held_up else Outcome.REACHED
        run.rest = run.rest or Rest(self._steady())
        if not run.rest.look(self._steady(), self.opening):
            return stop
        distance = 1e3 * abs(self.opening - run.target)
        run.reason = f'the gripper reports that it is there, but the measured opening is {distance:.0f} mm off'
        return Outcome.GRIPPER_FAILED if result.reached_goal else Outcome.STALLED

    def _drives(self, run: _Run) -> bool:
        """Command the gripper at the start and at each change of speed. Returns True if the gripper should move."""
        speed = run.task.speed if run.task else 0.0
        if speed and speed != run.speed:
            run.speed, run.rest = speed, None
            self.commands.drive(run.target, speed)
        return speed > 0

    def _stop(self, run: _Run, by_cancel: bool) -> None:
        run.by_cancel, run.stop_since = by_cancel, self._steady()
        self.commands.stop(math.nan if by_cancel else self.opening)

    def _insist(self, run: _Run) -> None:
        """Stop the gripper by the other method, or give up if the other method was not confirmed either."""
        if run.by_cancel is self._cancels and not self._is_cancel_due(run):
            self._stop(run, not self._cancels)
            return
        has_opened = run.opens and run.outcome is not None and self.commands.result is not None
        if run.outcome not in SILENCES and not has_opened:
            run.outcome = Outcome.NOT_STOPPED
        self.commands.give_up()
        self._finish(run)

    def _finish(self, run: _Run) -> None:
        if run is self._run:
            self._run = None
        if not run.opens and self.commands.is_doubtful and run.outcome not in TOLD_IN_DOUBT:
            run.outcome = Outcome.NOT_STOPPED
        outcome = self.last = run.outcome or Outcome.NOT_KNOWN
        is_held = run.goal is not None and self.touch.contact is GraspContact.TWO_SIDED and self.is_current
        succeeds = outcome in SUCCESSES or (outcome is Outcome.STALLED and is_held)
        pads = (self.touch if self.is_current else NO_TOUCH).pads
        self._on_end(run.handle, Ending(outcome, run.is_hold, succeeds, self._reasons(run), self.opening, pads))
        if self._settings.hold and outcome is Outcome.FORCE_REACHED and run.goal and not run.goal.until_touched:
            held = Holding(run.goal, self._settings, self._steady(), self.opening)
            self._run = _Run(run.handle, run.wish, held, waits=False)

    def _reasons(self, run: _Run) -> tuple[str, ...]:
        texts = [run.reason] * bool(run.reason) + [IN_DOUBT] * self.commands.is_doubtful
        limit = run.goal.force if run.goal is not None else math.nan
        if self.force - limit >= LEAST_EXCESS:
            texts.append(f'{self.force - limit:.1f} N more than the {limit:g} N of the goal')
        return tuple(texts)
