"""Tests of the gripper node while it holds with a force.

The tests cover the changes that the node follows or ignores, and the end of the hold.
"""

import math
import signal
from functools import partial

import pytest
from action_msgs.msg import GoalStatus
from gripper_bench import PERIOD, STEP
from test_gripper_node import KINDS, MAX_AGE, NOT_SEEN, SILENT, SLOW_RISE, hide, set_, unseen

from tactile_node.grasp.closing import Outcome, TouchLimits
from tactile_node.grasp.holding import BLIND_TIME, HoldLimits
from tactile_node.nodes.gripper_node import LOOK_PERIOD
from tactile_skin.msg import ContactMotion

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.usefixtures('control_msgs')]

LIMITS, FORCE = TouchLimits(), 5.0
LONG = pytest.mark.long
DEADBAND = LIMITS.stiffness * HoldLimits.gripper_step + LIMITS.overshoot(LIMITS.slow_speed)
SHRINKS = 0.0015  # Decrease in the object's width [m], which reduces the force by 1.5 N.


@pytest.fixture
def make_bench(ros):
    from gripper_bench import GripperBench
    return partial(GripperBench, ros)


@pytest.fixture
def held(make_bench):
    """Return a function that makes a bench whose gripper holds with the force FORCE."""
    def make(kind=KINDS[0], **parameters):
        bench = make_bench(kind, {'hold': True, **parameters})
        hold(bench)
        return bench
    return make


def hold(bench):
    """Close from a short distance until the gripper holds."""
    bench.motor.move_to(bench.pads.width + 0.001)
    bench.wait(0.2)
    status, _, outcome = bench.close(position=0.0, effort=FORCE)
    assert (status, outcome.outcome, outcome.of_hold) == (GoalStatus.STATUS_SUCCEEDED, Outcome.FORCE_REACHED, False)
    bench.goal_id = outcome.goal_id.tolist()
    bench.wait(0.2)
    bench.motor.commands.clear()


def force(bench):
    return max(bench.pads.forces())


def ended(bench):
    """Wait until the hold has ended, and return its outcome."""
    bench.until(lambda: ends(bench))
    end, = ends(bench)
    assert end.goal_id.tolist() == bench.goal_id
    return end.outcome


def ends(bench):
    return [each for each in bench.client.outcomes if each.of_hold]


@pytest.mark.parametrize('kind', [KINDS[0], pytest.param(KINDS[1], marks=LONG)])
def test_the_opening_follows_what_gives_way_and_the_goal_has_ended_before(held, kind):
    bench = held(kind, hold_travel=0.02)
    bench.pads.strongest = 0.0
    speed = LIMITS.slow_speed if kind == KINDS[0] else LIMITS.fast_speed
    for _ in range(3):
        # A fast gripper moves further before it stops, so the object must shrink more.
        bench.pads.width -= SHRINKS + (speed - LIMITS.slow_speed) * LIMITS.latency * 2
        bench.until(lambda: force(bench) > FORCE - 0.1)
        bench.wait(0.2)
        assert not bench.motor.moves
    assert bench.pads.strongest <= FORCE + speed * PERIOD * LIMITS.stiffness
    assert {each.effort for each in bench.motor.commands} == {10.0} and not ends(bench)


@pytest.mark.parametrize(('parameters', 'effort', 'shrinks'), [({}, FORCE, SHRINKS), ({'hold': True}, 0.0, 2e-5)])
def test_no_hold_starts_by_default_or_after_a_goal_without_effort(make_bench, parameters, effort, shrinks):
    bench = make_bench(parameters=parameters)
    bench.close(position=0.0, effort=effort)
    bench.wait(0.1)
    bench.motor.commands.clear()
    bench.pads.width -= shrinks
    bench.wait(0.5)
    assert not bench.motor.commands and force(bench) < FORCE - 1


def test_the_gripper_opens_again_by_as_much_as_it_has_closed(held):
    bench = held()
    first = bench.motor.opening
    bench.pads.width -= SHRINKS
    bench.until(lambda: force(bench) > FORCE - 0.1)
    bench.wait(0.3)
    bench.pads.width += SHRINKS / 2
    bench.until(lambda: force(bench) < FORCE + 0.1)
    bench.pads.width += SHRINKS / 2 + 0.002
    bench.until(lambda: bench.motor.opening >= first - 2e-4)
    bench.wait(0.5)
    assert bench.motor.opening <= first + 2e-4 and force(bench) > FORCE + 1 and not ends(bench)


@pytest.mark.parametrize(('moving', 'raised'), [
    (ContactMotion.SLIDING | ContactMotion.TURNING, 0.5), (ContactMotion.SHIFTING | ContactMotion.TURNING, 0.0),
    pytest.param(ContactMotion.STILL, 0.0, marks=LONG)])
def test_the_gripper_presses_harder_if_a_pad_reports_a_slide(held, moving, raised):
    bench = held(slide_force_step=0.5, highest_force=FORCE + 0.5)
    bench.pads.change = set_(motions=[ContactMotion(moving=ContactMotion.STILL), ContactMotion(moving=moving)])
    if raised:
        bench.until(lambda: force(bench) > FORCE + raised - 0.1)
    bench.wait(0.5)
    assert force(bench) == pytest.approx(FORCE + raised, abs=DEADBAND) and not ends(bench)
    assert bool(bench.motor.commands) == bool(raised)


HIDDEN = [set_(hidden_taxels=[2, 0]), set_(saturated_taxels=[0, 1]), set_(force_is_bound=[True, False]),
          set_(forces=[math.nan, 3.0])]


# test_gripper_node.py stops for each of these changes, and test_holding.py ends a hold for each of their states.
@pytest.mark.parametrize(('change', 'outcome'), [
    (NOT_SEEN[0], Outcome.NOT_SEEN), (HIDDEN[0], Outcome.FORCE_NOT_KNOWN),
    *(pytest.param(change, Outcome.NOT_SEEN, marks=LONG) for change in NOT_SEEN[1:]),
    *(pytest.param(change, Outcome.FORCE_NOT_KNOWN, marks=LONG) for change in HIDDEN[1:])])
def test_untrusted_readings_do_not_move_the_gripper_and_end_the_hold(held, change, outcome):
    bench = held()
    hide(bench, change)
    bench.wait(0.05)
    bench.pads.width -= SHRINKS
    assert ended(bench) == outcome and not bench.motor.commands


def test_the_hold_waits_while_a_pad_is_unseen_for_a_moment(held):
    bench = held()
    bench.pads.change = set_(hidden_taxels=[3, 0])
    bench.wait(0.05)
    bench.pads.width -= SHRINKS
    bench.wait(0.4)
    assert not bench.motor.commands
    bench.pads.change = lambda message: message
    bench.until(lambda: force(bench) > FORCE - 0.1)
    assert not ends(bench)


def test_the_gripper_does_not_press_harder_on_a_possibly_larger_force(held):
    bench = held()
    bench.pads.change = set_(force_is_bound=[True, True], at_edge=[True, True])
    bench.wait(0.05)
    bench.pads.width -= SHRINKS  # The pads read 3.5 N, but the true force may be up to 7 N.
    bench.wait(0.5)
    assert not bench.motor.commands and not ends(bench)


def closes(bench):
    """Shrink the object, and wait until the gripper starts to close."""
    bench.pads.width -= 0.004
    bench.until(lambda: bench.motor.moves)


@pytest.mark.parametrize('change', [
    unseen, SILENT, *(pytest.param(each, marks=LONG) for each in NOT_SEEN if each not in (unseen, SILENT))])
def test_a_correction_stops_when_a_pad_is_no_longer_seen(held, change):
    bench = held()
    bench.motor.slowness = 5.0
    closes(bench)
    hide(bench, change)
    before = bench.motor.opening
    bench.until(lambda: not bench.motor.moves)
    stopped = bench.motor.opening
    assert before - stopped <= LIMITS.slow_speed / bench.motor.slowness * (MAX_AGE + LOOK_PERIOD + STEP)
    assert ended(bench) == Outcome.NOT_SEEN and bench.motor.opening == stopped


def test_using_up_the_travel_ends_the_hold(held):
    bench = held(hold_travel=0.003)
    first = bench.motor.opening
    while not ends(bench) and bench.motor.opening > first - 0.01:
        bench.pads.width -= 2e-5
        bench.wait(0.01)
    assert ended(bench) == Outcome.HOLD_ENDED and not bench.motor.moves
    assert first - bench.motor.opening == pytest.approx(0.003, abs=LIMITS.slow_speed * (LOOK_PERIOD + STEP))
    stopped = bench.motor.opening
    bench.pads.width -= SHRINKS
    bench.wait(0.5)
    assert bench.motor.opening == stopped


def test_losing_the_object_ends_the_hold(held):
    bench = held()
    bench.pads.width = 0.0
    assert ended(bench) == Outcome.LOST
    stopped = bench.motor.opening
    assert stopped > 0.03
    bench.wait(0.3)
    assert bench.motor.opening == stopped and not bench.motor.moves


def test_a_new_goal_ends_the_hold_and_is_held_itself(held):
    bench = held()
    refused = bench.close(position=math.nan)[2]
    assert refused.outcome == Outcome.REFUSED and not ends(bench)
    status, _, outcome = bench.close(position=0.0, effort=8.0)
    assert outcome.outcome == Outcome.FORCE_REACHED and not outcome.of_hold
    assert [each.outcome for each in ends(bench)] == [Outcome.REPLACED]
    bench.pads.width -= SHRINKS
    bench.until(lambda: force(bench) > 8.0 - 0.1)


@pytest.mark.parametrize('change', [
    lambda message: message, SILENT, *(pytest.param(each, marks=LONG) for each in NOT_SEEN if each is not SILENT)])
def test_opening_always_ends_the_hold(held, change):
    bench = held()
    closes(bench)
    hide(bench, change)
    assert bench.close(position=0.08)[2].outcome == Outcome.REACHED and bench.motor.opening == pytest.approx(0.08)
    assert ended(bench) == Outcome.REPLACED
    bench.wait(BLIND_TIME + MAX_AGE + 0.2)
    assert bench.motor.opening == pytest.approx(0.08) and len(ends(bench)) == 1


def test_a_cancel_of_the_goal_that_has_ended_changes_nothing(make_bench):
    bench = make_bench(parameters={'hold': True})
    bench.motor.move_to(bench.pads.width + 0.001)
    handle = bench.client.send(position=0.0, effort=FORCE)
    bench.client.result(handle)
    answer = handle.cancel()
    bench.until(answer.done)
    assert not answer.result().goals_canceling
    bench.pads.width -= SHRINKS
    bench.until(lambda: force(bench) > FORCE - 0.1)
    assert not ends(bench)


@pytest.mark.parametrize(('fault', 'expected'), [
    (lambda bench: bench.motor.die(), Outcome.NO_GRIPPER),
    pytest.param(lambda bench: setattr(bench.motor, 'rejects', True), Outcome.GRIPPER_REFUSED, marks=LONG),
    pytest.param(lambda bench: bench.motor.fall_silent(), Outcome.GRIPPER_SILENT, marks=LONG),
    (lambda bench: setattr(bench.motor, 'blocked_at', bench.motor.opening), Outcome.STALLED)],
    ids=['dead', 'rejects', 'silent', 'stalls'])
def test_a_gripper_that_does_not_accept_the_correction_ends_the_hold(held, fault, expected):
    bench = held()
    fault(bench)
    bench.pads.width -= SHRINKS
    assert ended(bench) == expected


def test_a_correction_that_a_cancel_does_not_stop_gets_a_goal_at_the_current_opening(held):
    bench = held()
    bench.motor.stays = True
    bench.pads.width -= SHRINKS
    bench.until(lambda: any(each.position > 0 for each in bench.motor.commands))
    bench.wait(1.0)
    assert FORCE - DEADBAND < force(bench) < FORCE + LIMITS.slow_speed * LIMITS.stiffness * 0.5 + SLOW_RISE
    assert not ends(bench)


def test_a_node_that_ends_in_a_correction_stops_the_gripper(held):
    bench = held()
    bench.motor.slowness = 5.0
    closes(bench)
    bench.node.destroy_node()
    before = bench.motor.opening
    bench.wait(0.4)
    assert before - bench.motor.opening <= LIMITS.slow_speed * 2 * STEP and bench.motor.cancels


@LONG
def test_killed_in_a_correction_the_gripper_has_a_safe_command(make_bench):
    bench = make_bench(has_node=False)
    with bench.node_as_process('hold:=true') as process:
        hold(bench)
        bench.motor.slowness = 5.0
        closes(bench)
        process.send_signal(signal.SIGKILL)
        process.wait()
        bench.wait(0.2)
        assert bench.motor.moves and {each.effort for each in bench.motor.commands} == {10.0}
