"""Tests of the rules with which the gripper node commands the gripper, stops it and ends a goal.

test_gripper_node.py tests the same rules behind real nodes, where actions, messages or processes matter.
"""

import math

import pytest
from control_bench import NOT_SEEN, ControlBench, unchanged, unseen
from virtual_gripper import PERIOD, STEP, THRESHOLD

from tactile_node.gripper.rules.closing import REST_TIME, ForceReading, Outcome
from tactile_node.gripper.rules.touch_settings import TouchSettings

LIMITS = TouchSettings()
MAX_AGE = LIMITS.max_age
#: Increase in the force between two frames [N].
FAST_RISE = LIMITS.fast_speed * PERIOD * LIMITS.stiffness
SLOW_RISE = LIMITS.slow_speed * PERIOD * LIMITS.stiffness
#: Largest travel from the last seen frame until the gripper stops [m].
BLIND_TRAVEL = LIMITS.fast_speed * (MAX_AGE + 2 * STEP)


@pytest.mark.parametrize('stop_by', ['cancel', 'goal'])
@pytest.mark.parametrize('commands_speed', [True, False])
def test_a_goal_without_a_force_ends_when_both_pads_are_touched(commands_speed, stop_by):
    bench = ControlBench(commands_speed, stop_by=stop_by)
    ending = bench.close()
    assert (ending.succeeds, ending.outcome) == (True, Outcome.TOUCHED)
    before = bench.motor.opening
    bench.wait(0.3)
    assert bench.motor.opening == pytest.approx(before, abs=2e-4)  # The gripper must hold its position.
    assert ending.opening == pytest.approx(before, abs=1e-3)
    assert THRESHOLD < bench.pads.strongest <= THRESHOLD + FAST_RISE
    assert bench.motor.cancels == (stop_by == 'cancel')


def test_a_goal_with_a_force_closes_slowly_after_the_touch():
    bench = ControlBench()
    assert bench.outcome(force=5.0) is Outcome.FORCE_REACHED
    assert 5.0 <= bench.pads.strongest <= 5.0 + SLOW_RISE
    assert [each.speed for each in bench.motor.commands] == [LIMITS.fast_speed, LIMITS.slow_speed]


def test_the_gripper_reaches_its_goal_without_an_object():
    bench = ControlBench(pads={'width': 0.0})
    ending = bench.close(opening=0.03)
    assert (ending.succeeds, ending.outcome) == (True, Outcome.REACHED)
    assert bench.motor.opening == pytest.approx(0.03)


@pytest.mark.parametrize('change', NOT_SEEN)
def test_a_gripper_does_not_close_but_opens_while_a_pad_is_not_seen(change):
    bench = ControlBench()
    bench.hide(change)
    bench.wait(MAX_AGE + PERIOD)
    ending = bench.close()
    assert (ending.succeeds, ending.outcome, bench.motor.commands) == (False, Outcome.NOT_SEEN, [])
    assert ending.text == 'NOT_SEEN: unseen'
    ending = bench.close(opening=0.08)
    assert (ending.succeeds, ending.outcome, bench.motor.opening) == (True, Outcome.REACHED, 0.08)


@pytest.mark.parametrize('change', NOT_SEEN)
def test_the_gripper_stops_and_holds_when_a_pad_is_no_longer_seen(change):
    bench = ControlBench()
    sent = bench.send()
    bench.wait(0.1)
    before = bench.motor.opening
    bench.hide(change)
    ending = bench.result(sent)
    stopped = bench.motor.opening
    assert (ending.succeeds, ending.outcome) == (False, Outcome.NOT_SEEN)
    assert before < 0.06 and 0 < before - stopped <= BLIND_TRAVEL
    bench.wait(0.1)
    assert bench.motor.opening == stopped


@pytest.mark.parametrize(('commands_speed', 'stop_by'), [(False, 'goal'), (True, 'cancel')])
def test_the_gripper_rests_while_a_pad_is_briefly_unseen(commands_speed, stop_by):
    bench = ControlBench(commands_speed, stop_by=stop_by)
    sent = bench.send()
    bench.wait(0.3)
    bench.hide(unseen)
    bench.until(lambda: not bench.motor.moves)
    stopped = bench.motor.opening
    bench.wait(0.1)
    assert 0.0 < stopped < 0.06 and bench.motor.opening == stopped
    bench.hide(unchanged)
    assert bench.result(sent).outcome is Outcome.TOUCHED and bench.motor.opening < stopped


def test_one_pad_that_pushes_stops_it_at_the_limit():
    bench = ControlBench(pads={'off': 0.01})
    ending = bench.close()
    assert (ending.succeeds, ending.outcome) == (False, Outcome.ONE_SIDED)
    assert LIMITS.touch_force <= bench.pads.strongest <= LIMITS.touch_force + SLOW_RISE


def test_a_cancelled_goal_stops_the_gripper():
    bench = ControlBench()
    sent = bench.send()
    bench.wait(0.3)
    sent.cancel()
    assert bench.result(sent).outcome is Outcome.CANCELED and not bench.motor.moves


def test_a_later_goal_replaces_the_one_before():
    bench = ControlBench()
    first = bench.send()
    bench.wait(0.2)
    second = bench.send(opening=0.08)
    assert bench.result(first).outcome is Outcome.REPLACED
    assert bench.result(second).outcome is Outcome.REACHED and bench.motor.opening == pytest.approx(0.08)


def test_a_second_gripper_node_stops_a_goal_but_not_one_to_open():
    bench = ControlBench()
    sent = bench.send()
    bench.wait(0.2)
    bench.duplicates.text = 'another one is heard'
    ending = bench.result(sent)
    assert (ending.outcome, ending.text) == (Outcome.DUPLICATE, 'DUPLICATE: another one is heard')
    assert not bench.motor.moves and bench.outcome(opening=0.08) is Outcome.REACHED


def test_pads_that_already_press_with_more_than_the_goal_end_it_and_nothing_is_sent():
    bench = ControlBench(hold=True)
    bench.press(9.2)
    ending = bench.close(force=2.0)
    assert (ending.succeeds, ending.outcome, bench.motor.commands) == (False, Outcome.ALREADY_PRESSED, [])
    assert '7.2 N more than the 2 N' in ending.text
    bench.pads.width -= 0.009
    bench.wait(1.0)
    assert not bench.motor.commands and bench.control.work == 'none'


def test_a_late_command_is_followed_by_a_goal_to_hold_if_a_cancel_does_not_stop():
    bench = ControlBench(stop_by='goal')
    bench.motor.coasts = True
    bench.motor.fall_silent()
    assert bench.outcome() is Outcome.GRIPPER_SILENT
    bench.motor.wake()
    bench.until(lambda: bench.motor.directions[-1:] == ['hold'])
    held_at = bench.motor.opening
    bench.wait(1.0)
    assert bench.motor.opening == pytest.approx(held_at, abs=1e-3)


def test_a_force_within_the_overshoot_is_reached_and_the_text_states_the_excess():
    bench = ControlBench()
    for force, text in ((2.5, 'FORCE_REACHED: 0.5 N more than the 2 N of the goal'), (2.0, 'FORCE_REACHED')):
        bench.press(force)
        ending = bench.close(force=2.0)
        assert (ending.succeeds, ending.text, bench.motor.commands) == (True, text, [])


@pytest.mark.parametrize('change', [unchanged, *NOT_SEEN])
@pytest.mark.parametrize('opening', [LIMITS.widest, LIMITS.widest + 0.005])
def test_a_goal_to_open_to_the_widest_is_always_sent(opening, change):
    """The rules send the goal even if the pads are pressed or not seen, and even with numbers refused for closing."""
    bench = ControlBench()
    bench.motor.slowness = 0.1
    for goal in ({}, {'speed': -1.0}, {'speed': math.nan}, {'speed': 99.0}, {'force': math.nan}, {'force': 1e9},
                 {'force': -1.0}):
        bench.hide(unchanged)
        bench.press(9.0)
        bench.hide(change)
        bench.wait(MAX_AGE + PERIOD)
        assert bench.outcome(opening=opening, **goal) is Outcome.REACHED, goal
        assert [each.opening for each in bench.motor.commands] == [opening]


def test_pads_that_are_seen_to_press_only_while_it_opens_do_not_stop_it():
    """The last reading before the pads went blind must not count as the initial force."""
    bench = ControlBench()
    bench.hide(None)
    bench.wait(MAX_AGE + PERIOD)
    bench.motor.move_to(bench.pads.width - 0.009)
    sent = bench.send(opening=LIMITS.widest)
    bench.wait(2 * STEP)
    bench.hide(unchanged)
    assert bench.result(sent).outcome is Outcome.REACHED


@pytest.mark.parametrize('bad', [{'force': -1.0}, {'force': 1000.0}, {'opening': math.nan}, {'opening': -0.5},
                                 {'opening': math.inf}, {'speed': -0.1}, {'speed': 0.2}], ids=str)
def test_a_refused_goal_changes_nothing(bad):
    bench = ControlBench()
    first = bench.send()
    ending = bench.close(**{'opening': 0.01, **bad})
    assert (ending.succeeds, ending.outcome) == (False, Outcome.REFUSED) and 'expected' in ending.text
    assert bench.result(first).outcome is Outcome.TOUCHED


def test_a_gripper_without_a_server_does_not_accept_the_command():
    bench = ControlBench()
    bench.motor.die()
    ending = bench.close()
    assert (ending.succeeds, ending.outcome) == (False, Outcome.NO_GRIPPER)


def test_a_gripper_that_stalls_by_itself():
    bench = ControlBench(pads={'width': 0.0})
    bench.motor.blocked_at = 0.05
    ending = bench.close()
    assert (ending.succeeds, ending.outcome) == (False, Outcome.STALLED)


@pytest.mark.parametrize('stop_by', ['cancel', 'goal'])
def test_a_gripper_that_takes_one_goal_at_a_time_is_stopped_by_a_cancel(stop_by):
    """While its first command is active, the gripper rejects a slower speed at the first touch and a goal to hold."""
    bench = ControlBench(stop_by=stop_by)
    bench.motor.most_goals = 1
    ending = bench.close(force=10.0)
    assert (ending.succeeds, ending.outcome, bench.motor.moves) == (False, Outcome.GRIPPER_REFUSED, False)
    assert bench.pads.strongest <= THRESHOLD + 2 * FAST_RISE


def test_a_gripper_wider_than_widest_is_not_closed_by_a_goal_to_open():
    bench = ControlBench(pads={'width': 0.1})
    bench.motor.move_to(0.14)
    bench.wait(0.1)
    assert bench.outcome(opening=0.09) is Outcome.TOUCHED and bench.motor.opening > 0.09
    bench.hide(unseen)
    assert bench.outcome(opening=0.13) is Outcome.REACHED and bench.motor.opening == pytest.approx(0.13)


def test_a_goal_between_while_it_opens_is_guarded():
    """When the gripper receives the goal, the jaws may be further open than at the last reading."""
    bench = ControlBench()
    bench.hide(unseen)
    bench.wait(MAX_AGE + PERIOD)
    bench.send(opening=0.08)
    bench.wait(0.1)
    assert bench.outcome(opening=0.065) is Outcome.NOT_SEEN and not bench.motor.moves


def test_a_goal_that_waited_while_it_opened_is_guarded():
    """The goal to open was replaced, but the gripper has not yet confirmed the end of its command."""
    bench = ControlBench()
    bench.motor.stays = True
    bench.hide(unseen)
    bench.wait(MAX_AGE + PERIOD)
    bench.send(opening=0.08)
    bench.wait(0.1)
    bench.duplicates.has_listened = False
    sent = bench.send(opening=0.065)
    bench.duplicates.has_listened = True
    assert bench.result(sent).outcome is Outcome.NOT_SEEN
    bench.wait(0.1)
    assert bench.motor.opening < 0.064 and not bench.motor.moves


def test_a_goal_that_waits_for_a_gripper_that_never_ends_its_command_is_not_stopped():
    """The gripper accepts the goal to hold, but never reports the end of the replaced command."""
    bench = ControlBench()
    bench.motor.stays = bench.motor.never_ends = True
    bench.send()
    bench.wait(0.2)
    bench.duplicates.has_listened = False
    assert bench.outcome(opening=0.07) is Outcome.NOT_STOPPED


def test_a_goal_to_close_waits_until_the_process_has_listened_and_one_to_open_does_not():
    bench = ControlBench()
    bench.duplicates.has_listened = False
    sent = bench.send()
    bench.wait(0.5)
    assert sent.ending is None and not bench.motor.commands
    assert bench.outcome(opening=0.08) is Outcome.REACHED and len(bench.motor.commands) == 1
    assert sent.ending.outcome is Outcome.REPLACED
    waiting = bench.send()
    bench.wait(0.1)
    waiting.cancel()
    assert bench.result(waiting).outcome is Outcome.CANCELED and len(bench.motor.commands) == 1


def never_ends():
    """Return a bench whose gripper refuses to cancel a command to close.

    This gripper holds on request, but never ends a replaced command.
    """
    bench = ControlBench()
    sent = bench.send()
    bench.wait(0.2)
    bench.motor.stays = bench.motor.never_ends = True
    sent.cancel()
    ending = bench.result(sent)
    assert ending.outcome is Outcome.NOT_STOPPED and 'may still be moving' in ending.text
    bench.motor.commands.clear()
    return bench


def test_a_gripper_that_never_ends_a_command_closes_again_once_it_was_measured_at_rest():
    bench = never_ends()
    began = bench.now
    sent = bench.send()
    bench.until(lambda: bench.motor.commands)
    assert bench.now - began >= REST_TIME
    bench.motor.stays = bench.motor.never_ends = False
    assert bench.result(sent).outcome is Outcome.TOUCHED


def test_a_gripper_that_never_ends_a_command_and_moves_does_not_close_again():
    bench = never_ends()
    bench.motor.go_on_to(0.04, 0.003)
    assert bench.outcome() is Outcome.NOT_STOPPED and not bench.motor.commands


def test_a_gripper_that_never_ends_a_command_closes_only_after_a_restart_where_it_is_not_measured():
    bench = never_ends()
    bench.pads.knows_gap = False
    bench.wait(MAX_AGE + PERIOD)
    for _ in range(2):
        ending = bench.close()
        assert ending.outcome is Outcome.NOT_STOPPED and not bench.motor.commands
        assert 'refuses to cancel' in ending.text and 'restart' in ending.text
    assert bench.outcome(opening=LIMITS.widest) is Outcome.REACHED
    bench.motor.restart()
    bench.motor.stays = bench.motor.never_ends = False
    assert bench.outcome() is Outcome.TOUCHED


@pytest.mark.parametrize('commands_speed', [True, False])
def test_a_gripper_that_reports_success_early_stays_under_guard(commands_speed):
    """The controllers of ros2_control report success early, because their default goal_tolerance is 10 mm."""
    bench = ControlBench(commands_speed)
    bench.motor.is_hasty = True
    assert bench.outcome() is Outcome.TOUCHED
    bench.wait(0.3)
    assert bench.pads.strongest <= THRESHOLD + FAST_RISE


@pytest.mark.parametrize(('opening', 'blocked_at'), [(0.0, 0.05), (LIMITS.widest, 0.06)])
def test_a_gripper_that_reports_success_but_rests_elsewhere_has_failed(opening, blocked_at):
    bench = ControlBench(pads={'width': 0.0})
    bench.motor.is_hasty, bench.motor.blocked_at = True, blocked_at
    if opening:
        bench.motor.slowness = 1e9
    ending = bench.close(opening=opening)
    assert (ending.succeeds, ending.outcome) == (False, Outcome.GRIPPER_FAILED)
    assert f'measured opening is {1e3 * abs(bench.motor.opening - opening):.0f} mm' in ending.text


def test_a_report_of_success_is_trusted_if_the_opening_is_not_measured():
    bench = ControlBench(pads={'width': 0.0})
    bench.pads.knows_gap = False
    bench.wait(MAX_AGE + PERIOD)
    bench.motor.is_hasty = True
    assert bench.outcome(opening=0.03) is Outcome.REACHED


@pytest.mark.parametrize('stop_by', ['cancel', 'goal'])
def test_a_gripper_that_reported_success_early_is_stopped_at_its_opening(stop_by):
    """A cancel would find no command, so a goal stops the gripper, also when the rules are shut down."""
    bench = ControlBench(stop_by=stop_by)
    bench.motor.is_hasty = True
    sent = bench.send()
    bench.wait(0.2)
    sent.cancel()
    assert bench.result(sent).outcome is Outcome.CANCELED
    stopped = bench.motor.opening
    bench.send()
    bench.wait(0.2)
    bench.control.shut_down()
    bench.wait(0.3)
    assert bench.motor.directions == ['close', 'hold', 'close', 'hold'] and 0.05 < bench.motor.opening < stopped


def test_an_opening_gripper_that_stalls_or_presses_has_not_succeeded():
    bench = ControlBench()
    bench.close()
    bench.motor.slowness = 1e9
    sent = bench.send(opening=0.08)
    bench.wait(0.1)
    bench.motor.end('abort', stalled=True)
    ending = bench.result(sent)
    assert (ending.succeeds, ending.outcome) == (False, Outcome.STALLED)
    sent = bench.send(opening=0.08)
    bench.wait(0.1)
    bench.pads.width += 0.01  # A wrong sign of gap_scale would have this effect.
    ending = bench.result(sent)
    assert (ending.succeeds, ending.outcome) == (False, Outcome.NOT_OPENING)


def test_a_force_that_only_one_pad_knows_is_the_larger_force():
    bench = ControlBench()
    bench.hide(lambda touch: touch._replace(pads=(ForceReading(), ForceReading(3.0))))
    bench.wait(0.1)
    assert bench.control.force == 3.0
    bench.hide(None)
    bench.wait(MAX_AGE + PERIOD)
    assert math.isnan(bench.control.force)
