"""Tests of the rules while the gripper holds with a force: what they follow or ignore, and the end of the hold."""

import math

import pytest
from control_bench import NOT_SEEN, ControlBench, unchanged
from virtual_gripper import STEP

from tactile_node.gripper.rules.closing import Outcome
from tactile_node.gripper.rules.holding import BLIND_TIME
from tactile_node.gripper.rules.touch_settings import TouchSettings

LIMITS = TouchSettings()
FORCE = 5.0  # Force of the goal that the hold keeps [N].
DEADBAND = LIMITS.stiffness * LIMITS.gripper_step + LIMITS.overshoot(LIMITS.slow_speed)
SHRINKS = 0.0015  # Decrease in the object's width [m], which reduces the force by 1.5 N.


def held(**settings):
    """Return a bench whose gripper holds with the force FORCE."""
    bench = ControlBench(hold=True, **settings)
    bench.motor.move_to(bench.pads.width + 0.001)
    bench.wait(0.2)
    assert bench.outcome(force=FORCE) is Outcome.FORCE_REACHED
    bench.wait(0.2)
    bench.motor.commands.clear()
    return bench


def force(bench):
    return max(bench.pads.forces())


def ended(bench):
    """Wait until the hold has ended, and return its outcome."""
    bench.until(lambda: bench.hold_ends)
    outcome, = bench.hold_ends
    return outcome


@pytest.mark.parametrize(('hold', 'effort', 'shrinks'), [(False, FORCE, SHRINKS), (True, 0.0, 2e-5)])
def test_no_hold_starts_by_default_or_after_a_goal_without_a_force(hold, effort, shrinks):
    bench = ControlBench(hold=hold)
    bench.close(force=effort)
    bench.wait(0.1)
    bench.motor.commands.clear()
    bench.pads.width -= shrinks
    bench.wait(0.5)
    assert not bench.motor.commands and force(bench) < FORCE - 1


@pytest.mark.parametrize('commands_speed', [True, False])
def test_the_opening_follows_what_gives_way(commands_speed):
    bench = held(commands_speed=commands_speed, hold_travel=0.02)
    # A fast gripper moves further before it stops, so the object must shrink more.
    speed = LIMITS.slow_speed if commands_speed else LIMITS.fast_speed
    for _ in range(3):
        bench.pads.width -= SHRINKS + (speed - LIMITS.slow_speed) * LIMITS.latency * 2
        bench.until(lambda: force(bench) > FORCE - 0.1)
        bench.wait(0.2)
        assert not bench.motor.moves and not bench.hold_ends


def test_the_gripper_opens_again_by_as_much_as_it_has_closed():
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
    assert bench.motor.opening <= first + 2e-4 and force(bench) > FORCE + 1 and not bench.hold_ends


def closes(bench):
    """Shrink the object, and wait until the gripper starts to close."""
    bench.pads.width -= 0.004
    bench.until(lambda: bench.motor.moves)


@pytest.mark.parametrize('change', NOT_SEEN)
def test_a_correction_stops_when_a_pad_is_no_longer_seen(change):
    bench = held()
    bench.motor.slowness = 5.0
    closes(bench)
    bench.hide(change)
    before = bench.motor.opening
    bench.until(lambda: not bench.motor.moves)
    stopped = bench.motor.opening
    assert before - stopped <= LIMITS.slow_speed / bench.motor.slowness * (LIMITS.max_age + 2 * STEP)
    assert ended(bench) is Outcome.NOT_SEEN and bench.motor.opening == stopped


def test_losing_the_object_ends_the_hold():
    bench = held()
    bench.pads.width = 0.0
    assert ended(bench) is Outcome.LOST
    stopped = bench.motor.opening
    assert stopped > 0.03
    bench.wait(0.3)
    assert bench.motor.opening == stopped and not bench.motor.moves


def test_a_new_goal_ends_the_hold_and_is_held_itself():
    bench = held()
    assert bench.outcome(opening=math.nan) is Outcome.REFUSED and not bench.hold_ends
    assert bench.outcome(force=8.0) is Outcome.FORCE_REACHED
    assert bench.hold_ends == [Outcome.REPLACED]
    bench.pads.width -= SHRINKS
    bench.until(lambda: force(bench) > 8.0 - 0.1)


@pytest.mark.parametrize('change', [unchanged, *NOT_SEEN])
def test_opening_always_ends_the_hold(change):
    bench = held()
    closes(bench)
    bench.hide(change)
    assert bench.outcome(opening=0.08) is Outcome.REACHED and bench.motor.opening == pytest.approx(0.08)
    assert ended(bench) is Outcome.REPLACED
    bench.wait(BLIND_TIME + LIMITS.max_age + 0.2)
    assert bench.motor.opening == pytest.approx(0.08) and len(bench.hold_ends) == 1


@pytest.mark.parametrize(('fault', 'expected'), [
    (lambda bench: bench.motor.die(), Outcome.NO_GRIPPER),
    (lambda bench: setattr(bench.motor, 'rejects', True), Outcome.GRIPPER_REFUSED),
    (lambda bench: bench.motor.fall_silent(), Outcome.GRIPPER_SILENT),
    (lambda bench: setattr(bench.motor, 'blocked_at', bench.motor.opening), Outcome.STALLED)],
    ids=['dead', 'rejects', 'silent', 'stalls'])
def test_a_gripper_that_does_not_carry_out_the_correction_ends_the_hold(fault, expected):
    bench = held()
    fault(bench)
    bench.pads.width -= SHRINKS
    assert ended(bench) is expected


def test_a_shutdown_in_a_correction_stops_the_gripper():
    bench = held()
    bench.motor.slowness = 5.0
    closes(bench)
    bench.control.shut_down()
    before = bench.motor.opening
    bench.wait(0.4)
    assert before - bench.motor.opening <= LIMITS.slow_speed * 2 * STEP and bench.motor.cancels


def test_a_second_gripper_node_ends_the_hold():
    bench = held()
    bench.duplicates.text = 'another one is heard'
    assert ended(bench) is Outcome.DUPLICATE
