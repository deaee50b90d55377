"""The gripper node serves an action that closes the gripper until both pads are touched.

The node forwards commands to the gripper's own action. The node is not a safety function.
"""

import logging
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile

from tactile_node.errors import ConfigurationError, RefusedGoalError
from tactile_node.grasp.opening import HIGHEST_GAP, GapSource, LinearGap
from tactile_node.grasp.tracker import GraspContact
from tactile_node.gripper.duplicate_watch import DuplicateWatch, duplicate_text
from tactile_node.gripper.gripper_client import SILENCES, GripperClient, GripperResult
from tactile_node.gripper.gripper_settings import GripperSettings, limits_of
from tactile_node.gripper.health import gripper_status, unseen_text
from tactile_node.gripper.messages import GripperState, gripper_interface, touch_of
from tactile_node.gripper.rules.closing import (
    BEYOND,
    NO_TOUCH,
    SUCCESSES,
    Clearing,
    Closing,
    Goal,
    Outcome,
    Rest,
    TouchLimits,
    Widening,
    check_number,
    make_goal,
)
from tactile_node.gripper.rules.holding import Holding, HoldLimits
from tactile_node.nodes.grasp_requests import allow_feedback
from tactile_node.nodes.guarded_subscription import GuardedSubscription
from tactile_node.nodes.message_guard import publisher_names
from tactile_node.nodes.node_health import MessageHealth, publish_status
from tactile_node.nodes.run import run_node
from tactile_node.ros.grasp_checks import check_grasp
from tactile_node.ros.message_age import InputAge, age_seconds
from tactile_node.ros.parameters import declare, read
from tactile_node.ros.rosout_handler import of_node
from tactile_skin.msg import Grasp, GripperOutcome

LOOK_PERIOD = 0.01  #: Time between two checks of a goal [s]. The goal is also checked at each new grasp.
RESULT_TIMEOUT = 2  #: Time for which the server keeps a result that the client has not yet requested [s].
#: Sources whose opening counts as measured. The value of a parameter does not count, because it may be old.
MEASURED = (int(GapSource.JOINT_STATES), int(GapSource.TF))
LEAST_EXCESS = 0.05  #: If the force exceeds the goal's force by at least this much, the outcome's message says so [N].
NEAR = 0.002  #: Largest distance from the commanded opening at which the gripper counts as being there [m].
ROUNDING = 1e-6  #: Rounding error of an opening that is converted from the gripper's own unit [m].
#: Outcomes of a closing goal that are reported even if an unanswered command may still be moving the gripper. Any other
#: outcome is replaced by NOT_STOPPED while such a command remains.
TOLD_IN_DOUBT = (*SILENCES, Outcome.GRIPPER_REFUSED, Outcome.REFUSED, Outcome.REPLACED, Outcome.DUPLICATE)
IN_DOUBT = 'the gripper may still be moving, because it did not confirm the end of an earlier command'
NOT_ENDING = ('the gripper refuses to cancel an earlier command, and no measurement shows it at rest: provide its '
              'measured opening, or restart its driver')

logger = logging.getLogger(__name__)


@dataclass
class _Run:
    """A goal that the node is carrying out, or the hold that follows a goal."""

    handle: ServerGoalHandle
    opening: float = math.nan  #: commanded opening [m]

    #: task of the goal; `Holding` after the result of the goal was sent, None for a refused goal
    task: Widening | Closing | Holding | None = None
    #: True while the goal waits for the node to finish listening for duplicates, or for an earlier command to end
    waits: bool = True
    clearing: Clearing | None = None  #: checks whether earlier commands have ended while the goal waits for them
    speed: float = 0.0  #: commanded speed [m/s]; 0 before the first command and after a stop

    #: detects when the gripper is at rest although its reported and measured openings differ
    rest: Rest | None = None
    outcome: Outcome | None = None  #: outcome of the goal, or None while the goal is running
    reason: str = ''  #: text that explains the outcome to the client
    by_cancel: bool = True  #: True if a cancel is stopping the gripper, False if a command to hold is stopping it
    stop_since: float = math.inf  #: time when the node commanded the stop [s]

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


class GripperNode(Node):
    """Serves the action `~/gripper_cmd`, which a client calls instead of the gripper's own action.

    The gripper continues to close only while the messages on `grasp` allow it. A goal has the status ACCEPTED (in
    Lyrical EXECUTING) until its result is known. A new goal replaces the previous goal.

    Parameters
    ----------
    steady : callable
        Steady clock for ages and timeouts [s].
    **options
        Keyword arguments for rclpy's ``Node``.

    Raises
    ------
    ConfigurationError
        Raised if a parameter is invalid.
    """

    def __init__(self, *, steady: Callable[[], float] = time.monotonic, **options: Any):
        self._steady = steady
        self._run: _Run | None = None
        self._actions: list[GripperClient | ActionServer] = []
        super().__init__('touch_gripper', **options)
        declare(self, GripperSettings)
        self._settings = settings = read(self, GripperSettings)
        self._limits, self._hold_limits = limits_of(TouchLimits, settings), limits_of(HoldLimits, settings)
        self._law = LinearGap(settings.gap_offset, settings.gap_scale)
        self._interface = gripper_interface(settings.action_type, settings.joint)
        self._touch, self._ages = NO_TOUCH, InputAge(steady=steady)
        self._grasp, self._acquired = None, -math.inf
        self._last: Outcome | None = None
        self._gap = math.nan  # last measured opening [m]
        self._gap_measured = -math.inf  # time of the last measured opening [s]
        self._cancels = _is_cancel(settings.stop_by)
        self._client = GripperClient(self, self._interface, settings.gripper_action, self._law,
                                     effort=settings.gripper_effort, timeout=settings.answer_timeout, steady=steady,
                                     stay=lambda: math.nan if self._cancels else self._opening())
        self._actions.append(self._client)
        self._outcomes = self.create_publisher(GripperOutcome, '~/outcome', QoSProfile(depth=10))
        self._grasps = GuardedSubscription(self, Grasp, 'grasp', self._on_grasp, settings.input_qos, check=check_grasp,
                                           newest_only=True, steady=steady)
        self._watch = DuplicateWatch(self, (f'{settings.gripper_action}/touch_gripper', '~/heartbeat'), steady=steady)
        MessageHealth(self, [self._grasps], settings)
        publish_status(self, self._status)
        # The timer uses the steady clock, because with use_sim_time and no /clock, the node could not stop a closing
        # gripper.
        self._timer = self.create_timer(LOOK_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._timer.cancel()
        self._actions.append(ActionServer(
            self, self._interface.action, '~/gripper_cmd', execute_callback=lambda handle: None,
            handle_accepted_callback=self._on_accepted, cancel_callback=lambda handle: CancelResponse.ACCEPT,
            result_timeout=RESULT_TIMEOUT))

    def destroy_node(self) -> None:
        """Stop a closing gripper, because the node can no longer monitor it."""
        run = self._run
        if run is not None and not self._is_stopped(run) and self.context.ok():
            self._stop(run, self._cancels and not self._is_early(run), self._steady())
        self._run = None
        while self._actions:
            self._actions.pop().destroy()
        super().destroy_node()

    def _on_grasp(self, grasp: Grasp) -> None:
        arrival = self._ages.arrived(grasp)
        self._grasp, self._acquired = grasp, arrival.acquired
        is_only_one = self.count_publishers(self._grasps.topic) <= 1  # if two nodes publish grasps, either may be wrong
        self._touch = touch_of(grasp, arrival.acquired).after(self._touch) if is_only_one else NO_TOUCH
        # The age is NaN if neither age is known, and inf if only the age on arrival is not known.
        held_back = arrival.age_on_arrival - age_seconds(grasp.age)
        if is_only_one and held_back != math.inf and grasp.gap_source in MEASURED and math.isfinite(grasp.gap):
            sent = arrival.steady - (0.0 if math.isnan(held_back) else held_back)
            self._gap, self._gap_measured = grasp.gap, sent - age_seconds(grasp.gap_age)
        self._look()
        if self._run is not None and self._run.outcome is None and not self._run.is_hold:
            self._run.handle.publish_feedback(self._interface.fill(self._interface.action.Feedback(), self._state()))

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        allow_feedback(handle)
        run = _Run(handle)
        self._decide(run)
        if run.outcome is not None:
            self._finish(run)
            return
        if self._run is not None:
            self._run.outcome = Outcome.REPLACED
            self._finish(self._run)
        self._begin(run)
        self._look()

    def _begin(self, run: _Run) -> None:
        self._run = run
        self._timer.reset()

    def _decide(self, run: _Run) -> None:
        """Decide from the current opening whether the goal opens or closes the gripper, or refuse the goal."""
        now, present = self._steady(), self._opening()
        try:
            command = self._interface.command(run.handle.request)
            run.opening = self._law.gap(command.position)
            check_number('opening', run.opening, -BEYOND, HIGHEST_GAP, 'm')
            if self._opens(run.opening, present):
                run.task = Widening(run.opening, self._limits, now, present)
                return
            goal = make_goal(run.opening, command.speed * abs(self._law.scale), command.effort, self._limits,
                             speed_is_fixed=not self._interface.commands_speed)
            run.task = Closing(goal, self._limits, now, present)
        except RefusedGoalError as error:
            logger.error('goal refused: %s', error, extra=of_node(self))
            run.outcome, run.reason = Outcome.REFUSED, str(error)

    def _opens(self, opening: float, present: float) -> bool:
        """Return True if a goal opens the gripper.

        ``opening`` is the commanded opening [m]; ``present`` is the measured opening [m], or NaN if it is not known.
        """
        if self._is_widest(opening):
            return not opening < present - NEAR
        before = self._run  # a gripper that is opening may be wider than last measured
        may_be_wider = self._client.farthest > opening or (before is not None and before.opens and before.speed > 0)
        return opening >= present and not may_be_wider and not self._client.is_doubtful

    def _opens_fully(self, run: _Run) -> bool:
        """Return True for a goal that fully opens the gripper. The node always forwards such a goal."""
        return run.opens and self._is_widest(run.opening)

    def _is_widest(self, opening: float) -> bool:
        return opening >= self._limits.widest - ROUNDING

    def _opening(self) -> float:
        """Return the measured opening [m], or NaN if the current opening is not known."""
        is_current = self._steady() - self._gap_measured <= self._limits.max_age
        return self._gap if is_current else self._client.opening(self._limits.max_age)

    def _is_current(self) -> bool:
        return self._touch.is_current(self._steady(), self._limits.max_age)

    def _look(self) -> None:
        """Continue, stop or end the current goal."""
        run, now = self._run, self._steady()
        if run is None:
            return
        if run.outcome is None:
            run.outcome = self._outcome(run, now)
            run.reason = self._reason(run.outcome) or run.reason
            if run.outcome is None and not run.waits and self._drives(run):
                return
            is_to_stop = run.outcome is not None or run.speed or run.stop_since == math.inf
            if not self._is_stopped(run) and is_to_stop:
                self._stop(run, (self._cancels or self._is_cancel_due(run)) and not self._is_early(run), now)
            run.speed = 0.0
        if self._client.is_stopped:
            if run.outcome is not None:
                self._finish(run)
            return
        if self._client.is_stop_vain(run.by_cancel) or now - run.stop_since > self._settings.answer_timeout:
            self._insist(run, now)

    def _is_cancel_due(self, run: _Run) -> bool:
        """Return True if only a cancel can stop the gripper.

        A command to hold cannot help if the latest command got no response, or if that command opened the gripper and
        has ended.
        """
        return self._client.is_silent or (run.opens and self._client.result is not None)

    def _is_early(self, run: _Run) -> bool:
        """Return True if the gripper reports the commanded opening, but another opening is measured.

        In this case, the gripper may still be moving.
        """
        result, present = self._client.result, self._opening()
        if not (run.speed and result is not None and result.says_reached):
            return False
        if run.opens:
            return present < min(run.opening, self._limits.widest) - NEAR
        return abs(present - run.opening) > NEAR

    def _is_stopped(self, run: _Run) -> bool:
        return self._client.is_stopped and not self._is_early(run)

    def _outcome(self, run: _Run, now: float) -> Outcome | None:
        if not run.is_hold and run.handle.is_cancel_requested:
            return Outcome.CANCELED
        if self._watch.topics and not self._opens_fully(run):
            return Outcome.DUPLICATE
        if run.waits:
            run.outcome = self._why_not_begin(run, now)
        if run.waits or run.outcome is not None or run.task is None:
            return run.outcome
        if not (run.opens or run.speed) and self._client.is_doubtful:
            return Outcome.NOT_STOPPED
        failure = self._client.failure() if run.speed else None
        if failure is not None:
            return failure
        stop = run.task.look(now, self._touch, self._opening(), is_still=self._is_stopped(run))
        result = self._client.result if run.speed else None
        if result is None or stop in SUCCESSES:
            return stop
        ending = self._ending(run, result, stop)
        has_eased = isinstance(run.task, Holding) and run.task.eases and ending is Outcome.REACHED
        return stop if has_eased else ending

    def _why_not_begin(self, run: _Run, now: float) -> Outcome | None:
        """Start a waiting goal as soon as possible. Return an outcome if the goal can never start, otherwise None."""
        if not self._opens_fully(run):
            if not self._watch.has_listened:
                return None
            if run.clearing is None and self._client.is_doubtful:
                run.clearing = Clearing(now, self._settings.answer_timeout)
                self._client.clear()
            if run.clearing is not None:
                is_answered, is_ended = self._client.clearing()
                end = run.clearing.look(now, self._opening(), is_answered=is_answered, is_ended=is_ended)
                if not run.clearing.is_over:
                    run.reason = NOT_ENDING if is_answered and not is_ended else ''
                    return end
                self._client.forget()
        self._decide(run)  # a new decision, because the gripper may have moved in the meantime
        run.waits = False
        return run.outcome

    def _reason(self, outcome: Outcome | None) -> str:
        if outcome is Outcome.NOT_SEEN:
            topic = self._grasps.topic
            return unseen_text(topic, self._grasps.counts, publisher_names(self, topic), self._grasp,
                               self._steady() - self._acquired, self._limits.max_age)
        return duplicate_text(self._watch.topics) if outcome is Outcome.DUPLICATE else ''

    def _status(self) -> DiagnosticStatus:
        work = 'none' if self._run is None else 'hold' if self._run.is_hold else 'goal'
        return gripper_status(self.get_fully_qualified_name(), self.resolve_topic_name(self._settings.gripper_action),
                              duplicate=duplicate_text(self._watch.topics), is_served=self._client.is_there, work=work,
                              last=self._last, grasp_age=self._steady() - self._touch.acquired)

    def _ending(self, run: _Run, result: GripperResult, stop: Outcome | None) -> Outcome | None:
        """Return the outcome of a goal after the gripper has ended its command.

        While the gripper may still be moving, the method returns ``stop``, which is the outcome of the task or None.
        """
        if not result.says_reached:
            return Outcome.STALLED if result.state.stalled else stop or Outcome.GRIPPER_FAILED
        if not self._is_early(run):
            is_held_up = isinstance(run.task, Closing) and self._touch.is_touched and not result.state.reached_goal
            return Outcome.STALLED if is_held_up else Outcome.REACHED
        run.rest = run.rest or Rest(self._steady())
        if not run.rest.look(self._steady(), self._opening()):
            return stop
        distance = 1e3 * abs(self._opening() - run.opening)
        run.reason = f'the gripper reports that it is there, but the measured opening is {distance:.0f} mm off'
        return Outcome.GRIPPER_FAILED if result.state.reached_goal else Outcome.STALLED

    def _drives(self, run: _Run) -> bool:
        """Command the gripper at the start and at each change of speed. Returns True if the gripper should move."""
        if isinstance(run.task, Holding):
            run.opening = run.task.target
        speed = run.task.speed if run.task else 0.0
        if speed and not (run.speed and (speed == run.speed or not self._interface.commands_speed)):
            run.speed, run.rest = speed, None
            self._client.drive(run.opening, speed)
        return speed > 0

    def _stop(self, run: _Run, by_cancel: bool, now: float) -> None:
        run.by_cancel, run.stop_since = by_cancel, now
        self._client.stop(math.nan if by_cancel else self._opening())

    def _insist(self, run: _Run, now: float) -> None:
        """Stop the gripper by the other method, or give up if the other method was not confirmed either."""
        if run.by_cancel is self._cancels and not self._is_cancel_due(run):
            self._stop(run, not self._cancels, now)
            return
        has_opened = run.opens and run.outcome is not None and self._client.result is not None
        if run.outcome not in SILENCES and not has_opened:
            run.outcome = Outcome.NOT_STOPPED
        self._client.give_up()
        self._finish(run)

    def _state(self, outcome: Outcome | None = None) -> GripperState:
        """Return the gripper state for feedback or a result, in the units of the gripper.

        The effort field contains the force on the more strongly pressed pad.
        """
        force = self._touch.strongest if self._is_current() else math.nan
        return GripperState(self._law.reading(self._opening()), force,
                            stalled=outcome in (Outcome.TOUCHED, Outcome.FORCE_REACHED, Outcome.STALLED),
                            reached_goal=outcome is Outcome.REACHED)

    def _finish(self, run: _Run) -> None:
        if run is self._run:
            self._run = None
            self._timer.cancel()
        if not run.opens and self._client.is_doubtful and run.outcome not in TOLD_IN_DOUBT:
            run.outcome = Outcome.NOT_STOPPED
        outcome = self._last = run.outcome or Outcome.NOT_KNOWN
        state = self._state(outcome)
        self._publish(run, outcome)
        if run.is_hold:
            return
        is_held = run.goal is not None and self._touch.contact is GraspContact.TWO_SIDED and self._is_current()
        succeeds = outcome in SUCCESSES or (outcome is Outcome.STALLED and is_held)

        def execute(handle: ServerGoalHandle) -> Any:
            end = handle.canceled if outcome is Outcome.CANCELED else handle.succeed if succeeds else handle.abort
            end()
            return self._interface.fill(self._interface.action.Result(), state)
        run.handle.execute(execute)
        if self._settings.hold and outcome is Outcome.FORCE_REACHED and run.goal and not run.goal.until_touched:
            held = Holding(run.goal, self._limits, self._hold_limits, self._steady(), self._opening())
            self._begin(_Run(run.handle, run.opening, held, waits=False))

    def _publish(self, run: _Run, outcome: Outcome) -> None:
        pads = (self._touch if self._is_current() else NO_TOUCH).pads
        texts = [run.reason] * bool(run.reason) + [IN_DOUBT] * self._client.is_doubtful
        force = run.goal.force if run.goal is not None and self._is_current() else math.nan
        if self._touch.strongest - force >= LEAST_EXCESS:
            texts.append(f'{self._touch.strongest - force:.1f} N more than the {force:g} N of the goal')
        text = f'{outcome.name}: {"; ".join(texts)}' if texts else outcome.name
        message = GripperOutcome(goal_id=run.handle.goal_id.uuid, outcome=int(outcome), of_hold=run.is_hold,
                                 message=text, opening=self._opening(),
                                 forces=[pad.force for pad in pads], force_is_bound=[pad.is_bound for pad in pads])
        message.header.stamp = self.get_clock().now().to_msg()
        self._outcomes.publish(message)
        is_usual = outcome in SUCCESSES or (run.is_hold and outcome is Outcome.REPLACED)
        if not is_usual and outcome is not Outcome.REFUSED:
            logger.warning('%s ended: %s', 'hold' if run.is_hold else 'goal', text, extra=of_node(self))


def _is_cancel(stop_by: str) -> bool:
    if stop_by not in ('cancel', 'goal'):
        raise ConfigurationError('stop_by', expected='cancel or goal', got=repr(stop_by),
                                 remedy='Test whether the gripper stops when its action is cancelled.')
    return stop_by == 'cancel'


def main() -> int:
    """Run the node and return the exit code."""
    return run_node(GripperNode)


if __name__ == '__main__':
    sys.exit(main())
