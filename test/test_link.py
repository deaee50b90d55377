"""The chain on two hosts that a bad link joins: a planner is not misled, nothing is lost silently, the driver runs on.

The short form has one world; with TACTILE_LONG (`make hosts`) every link, split and reader is tried, and what was
measured is printed (pytest -s).
"""

import os
import time
from contextlib import contextmanager

import pytest
from link_bench import MAX_AGE, SPLITS, LinkWorld
from link_catalogue import (
    CUTS,
    FLAT,
    LEASE,
    LINKS,
    PROFILE,
    RATES,
    RECOVERED,
    RECOVERED_AFTER_LEASE,
    STOP,
    TAKEN_AWAY,
    WARM,
    cut,
    lossy,
    slow,
    stopped,
)
from misled_bench import WITHDRAWN, TooSlowError, is_overloaded
from two_hosts import NoHostsError

pytestmark = [pytest.mark.ros, pytest.mark.bus]
long = pytest.mark.skipif('TACTILE_LONG' not in os.environ, reason='takes most of an hour: set TACTILE_LONG')

PERIOD = 0.05  # s between two frames: a busy machine keeps up
BAD = LINKS['5 % lost, 20 ms ± 10 ms']
SECONDS, CUT = 3.0, 3.0
RATE = '300kbit'  # half of what the taxels need


LONG_SECONDS = 20.0  # on each link


@contextmanager
def linked(split='taxels', profile=PROFILE, best_effort=True):
    try:
        with LinkWorld(split, period=PERIOD, profile=profile, parameters={'best_effort': best_effort}) as world:
            world.hold()
            yield world
    except NoHostsError as error:
        pytest.skip(str(error))


@pytest.fixture(scope='module')
def world():
    with linked() as world:
        yield world


def keeps(seconds, bound):
    """Whether it took no longer than ``bound``; TooSlowError where the machine has more to do than it can."""
    if seconds > bound and is_overloaded():
        raise TooSlowError(f'{seconds:.2f} s, expected {bound:.2f} s')
    return seconds <= bound


def test_a_link_that_loses_and_delays(world):
    found = lossy(world, BAD, SECONDS)
    assert found.passed.received and not found.passed.unnoticed
    assert 0 < found.passed.missed <= found.counted
    assert not found.empty, 'believed to hold nothing'
    assert keeps(found.touched, TAKEN_AWAY / 2), 'believed to hold what was taken away'
    assert not found.passed.waits, 'the driver waited for the link'


def test_a_link_that_is_cut(world):
    found = cut(world, CUT, BAD)
    assert 0 < found.passed.missed <= found.counted and not found.passed.unnoticed
    assert not found.touched, 'believed to hold what was taken away in the cut'
    assert keeps(found.latest, WITHDRAWN + PERIOD + world.latency), 'not withdrawn'
    assert keeps(found.recovered, RECOVERED)
    assert not found.passed.waits, 'the driver waited for the link'


def test_a_link_that_carries_less_than_is_sent(world):
    """A full socket must not hold up the driver, as it does without the profile."""
    try:
        found = slow(world, RATE, SECONDS)
    except NoHostsError as error:
        pytest.skip(str(error))
    assert found.missed and not found.waits, 'the driver waited for the link'


@long
@pytest.mark.parametrize('best_effort', [False, True])
@pytest.mark.parametrize('split', SPLITS)
def test_every_link_that_loses_and_delays(split, best_effort):
    with linked(split, None, best_effort) as world:
        for name, link in LINKS.items():
            found = lossy(world, link, LONG_SECONDS)
            print(f'\n{name}: {found}')
            assert not found.passed.unnoticed and not found.passed.waits, name
            assert found.passed.missed <= found.counted or split == 'grasps', name  # there the consumer sees the gap
            assert not found.empty and found.touched < TAKEN_AWAY / 2, name


@long
@pytest.mark.parametrize('profile', [None, PROFILE])
@pytest.mark.parametrize('split', SPLITS)
def test_every_link_that_is_cut(split, profile):
    with linked(split, profile) as world:
        for seconds in CUTS:
            found = cut(world, seconds, LINKS['20 ms ± 10 ms'])
            print(f'\n{seconds} s: {found}')
            assert not found.passed.unnoticed and not found.passed.waits, seconds
            assert found.recovered < (RECOVERED if seconds < LEASE else RECOVERED_AFTER_LEASE), seconds
            assert found.current < MAX_AGE and not found.touched, seconds


@long
def test_readers_that_stop_hold_up_no_driver():
    with linked(profile=None, best_effort=False) as world:
        beside = world.consume(world.link.first, {'stopped': 'left/taxels'})
        world.consume(world.link.second, {'slow': 'left/taxels'})
        time.sleep(WARM)  # what Python and DDS take for the first messages is taken
        for process in (beside, world.consumer, world.thinking):
            found = stopped(world, process.pid, STOP)
            print(f'\n{process.args}: {found}')
            assert not found.touched and not found.passed.waits and found.growth < FLAT


@long
@pytest.mark.parametrize('profile', [None, PROFILE])
def test_rates_of_the_link(profile):
    """What the profile is for: as it is the driver may wait for the link."""
    with linked(profile=profile) as world:
        for rate in RATES:
            found = slow(world, rate, LONG_SECONDS)
            print(f'\n{rate}: {found}')
            assert profile is None or not found.waits, rate
