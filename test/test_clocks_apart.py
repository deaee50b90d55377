"""Two hosts whose wall clocks are apart, drift and are set: what a consumer believes stays true, stamps are compared.

The wall clock of one side is that of libfaketime; the truth is the steady clock, which all processes share. Nothing
here asserts how fast anything is: a busy machine makes grasps old, and they have to say so. With TACTILE_LONG all
jumps, drifts and slews on either side are run, and a table of what was measured is printed (pytest -s).
"""

import os
import time
from itertools import pairwise
from statistics import median

import pytest
from clock_bench import HOSTS, LIBRARIES, ClockWorld, recovery
from misled_bench import empty, is_overloaded

pytestmark = [pytest.mark.ros, pytest.mark.bus,
              pytest.mark.skipif(not LIBRARIES, reason='libfaketime is not installed: apt install faketime')]
long = pytest.mark.skipif('TACTILE_LONG' not in os.environ, reason='takes minutes: set TACTILE_LONG')

MAX_AGE = 0.25      # s, of the grasp node
ERROR = 0.05        # s: by which an age may be too low (DelaySettings.error) or too high, beside what a test names
TEN = 10            # grasps in a row, of which the median may be too high: a busy machine scans its skin late
WAY = 0.3           # s that a message is on its way at most, by a busy machine
LIMIT = 0.05        # s that stamps may be ahead, and BEHIND that they may seem to be behind
BEHIND = 0.5
RESOLUTION = 0.001  # s, of what is reported
READ = 2.0          # s in which libfaketime reads a new setting
FORGOTTEN = 31.0    # s in which stamps from before a slew are
BURST = 10          # messages that are held back
JUMPS = (0.2, 1.0, 3600.0, -0.2, -1.0, -3600.0)


def check_ages(world, since=0.0, late=0.0):
    """No age is below the truth, none above by more than what is stated, nothing old is called fresh; the errors.

    An overloaded machine scans its simulated skin late, after the SYNC that ages count from.
    """
    ages = world.ages(since)
    assert ages
    errors = [each.age - each.true for each in ages]
    lowest, highest = min(errors), max(median(errors[k:k + TEN]) for k in range(max(1, len(errors) - TEN)))
    assert lowest >= -ERROR and (highest <= ERROR + late or is_overloaded()), (lowest, highest)
    sent = max((each.true - each.way for each in ages if each.fresh), default=0.0)
    assert sent <= MAX_AGE + ERROR or is_overloaded(), sent  # it may stand between the decision and the message
    return lowest, highest


def check_offsets(world, since=0.0):
    """Offsets are true but for the way unless a clock was set, CLOCKS_APART is given beyond the limits; the errors."""
    known = world.compared(since)
    assert known
    for report, error in known:
        assert -WAY <= error <= ERROR or is_overloaded(), (report, error)
        is_near = min(abs(report.offset - LIMIT), abs(report.offset + BEHIND)) <= RESOLUTION
        if not is_near and 'SILENT' not in report.faults:
            assert ('CLOCKS_APART' in report.faults) == (not -BEHIND < report.offset < LIMIT), report
    errors = [error for _, error in known]
    return min(errors), max(errors)


def wait_for_reports(world, since):
    """Until all nodes that receive stamps have compared those from after ``since``."""
    def heard():
        return {report.node for report, _ in world.compared(since + READ)}
    world.wait(lambda: heard() >= {'/grasp', '/left/classifier', '/left/processor'}, 'the stamps to be compared')


def check_not_empty(world, since, until):
    assert not [record for record in world.grasps(since) if record['time'] < until and empty(record)]


def test_a_consumer_is_not_misled_by_a_clock_that_is_apart_drifts_and_is_set_back():
    with ClockWorld(bus='+0.2 x1.0005') as world:
        held = world.hold()
        world.hosts['bus'].set('-0.8 x1.0005')
        jumped = time.monotonic()
        world.relays[0].hold_back(BURST)
        world.wait(lambda: world.relays[0].is_full, 'ten messages')
        world.relays[0].release()
        world.relays[0].pass_on()
        world.hold(jumped + 2.0)
        wait_for_reports(world, jumped)
        taken = time.monotonic()
        check_not_empty(world, held, taken)
        world.skin.set(is_there=False)
        world.wait(lambda: any(record['contact'] == 'NO_CONTACT' for record in world.grasps(taken)), 'no contact')
        check_ages(world, held)
        check_offsets(world)
        last = [report for report, _ in world.compared(jumped + READ) if report.node == '/grasp'][-1]
        assert 0.2 - WAY < last.offset < 0.2 + ERROR or is_overloaded()  # the clock was set back, its stamps were not


@long
@pytest.mark.parametrize('situation', ['held', 'taken away', 'held back'])
@pytest.mark.parametrize('side', HOSTS)
def test_clocks_that_jump(side, situation):
    jumps = JUMPS if situation == 'held' else [jump for jump in JUMPS if abs(jump) <= 1]
    with ClockWorld() as world:
        held, offset, rows = world.hold(), 0.0, []
        for jump in jumps:
            time.sleep(2.0)
            offset += jump
            began = time.monotonic()
            begin(world, situation)
            world.hosts[side].set(f'{offset:+g}')
            over = end(world, situation, began)
            wait_for_reports(world, began)
            lowest, highest = check_ages(world, began)
            rows.append((f'{jump:+g} s', over, lowest, highest))
        if situation != 'taken away':
            check_not_empty(world, held, time.monotonic())
        show(f'{side}, {situation}', rows, *check_offsets(world))


def begin(world, situation):
    if situation == 'taken away':
        world.skin.set(is_there=False)
    elif situation == 'held back':
        for relay in world.relays:
            relay.hold_back(BURST)


def end(world, situation, began):
    """Until the truth is seen again, and for how long it was not [s]."""
    if situation == 'taken away':
        world.wait(lambda: any(record['contact'] == 'NO_CONTACT' for record in world.grasps(began)), 'no contact')
        over = next(record['time'] for record in world.grasps(began) if record['contact'] == 'NO_CONTACT')
        world.skin.set(is_there=True)
        world.hold(over)
        return over - began
    if situation == 'held back':
        world.wait(lambda: all(relay.is_full for relay in world.relays), 'ten messages')
        time.sleep(3.0)
        for relay in world.relays:
            relay.release()
            relay.pass_on()
    time.sleep(4.0)
    world.hold(time.monotonic())
    return recovery(world, began)


@long
@pytest.mark.parametrize('rate', [5e-4, -5e-4])
@pytest.mark.parametrize('side', HOSTS)
def test_clocks_that_drift(side, rate):
    with ClockWorld(**{side: f'+0.2 x{1 + rate:g}'}) as world:
        held = world.hold()
        time.sleep(60.0)
        check_not_empty(world, held, time.monotonic())
        lowest, highest = check_ages(world, held)
        show(f'{side}, drift {1e6 * rate:+.0f} ppm', [('60 s', recovery(world, held), lowest, highest)],
             *check_offsets(world))


@long
@pytest.mark.parametrize('way', [0.2, -0.2])
@pytest.mark.parametrize('side', HOSTS)
def test_clocks_that_are_slewed_as_fast_as_chrony_does(side, way):
    """83,333 ppm, its maxslewrate: slower stamps look late, for as long as the least difference is remembered."""
    with ClockWorld(at_once=True) as world:
        held = world.hold()
        world.hosts[side].slew(0.0, way, rate=1 / 12)
        slewed = time.monotonic()
        time.sleep(35.0)
        check_not_empty(world, held, time.monotonic())
        late = 0.2 if side == 'bus' and way < 0 else 0.0
        lowest, highest = check_ages(world, held, late)
        show(f'{side}, slewed {way:+g} s', [('35 s', recovery(world, held), lowest, highest)],
             *check_offsets(world, slewed + FORGOTTEN))


def show(name, rows, least, most):
    for what, without, lowest, highest in rows:
        ages = f'{lowest:+.3f} | {highest:+.3f}'
        print(f'\n| {name} | {what} | {without:.2f} | {ages} | {least:+.3f} | {most:+.3f} |', end='', flush=True)


def test_the_jumps_are_each_undone():
    """Else a later one would begin with stamps that are still ahead."""
    assert sum(JUMPS) == 0 and all(first > 0 or second < 0 for first, second in pairwise(JUMPS))
