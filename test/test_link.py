"""The chain on two hosts that a bad link joins: a planner is not misled, nothing is lost silently, the driver runs on.

The long form (TACTILE_LONG=1, `make hosts`) is link_catalogue.py with all its cases: it prints the tables of
docs/link.md.
"""

import os

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')

from link_bench import LinkWorld  # noqa: E402
from link_catalogue import LINKS, cut, lossy  # noqa: E402
from misled_bench import WITHDRAWN, TooSlowError, is_overloaded  # noqa: E402
from two_hosts import NoHostsError  # noqa: E402

pytestmark = [pytest.mark.ros, pytest.mark.bus]

PERIOD = 0.05  # s between two frames: a busy machine keeps up
BAD = LINKS['5 % lost, 20 ms ± 10 ms']
SECONDS, CUT = 4.0, 3.0
RECOVERED = 1.0  # s, after a cut that is shorter than the lease of DDS


@pytest.fixture(scope='module')
def world():
    try:
        with LinkWorld(period=PERIOD) as world:
            world.hold(0.0)
            yield world
    except NoHostsError as error:
        pytest.skip(str(error))


def test_a_link_that_loses_and_delays(world):
    found = lossy(world, BAD, SECONDS)
    print(found)
    assert world.link.counts().lost, 'the link has lost nothing'
    assert not found.passed.unnoticed and found.passed.received
    assert found.counted >= found.passed.missed
    assert not found.empty


def test_a_link_that_is_cut(world):
    found = cut(world, CUT, BAD)
    print(found)
    assert not found.passed.unnoticed and found.passed.missed
    assert found.counted >= found.passed.missed
    assert not found.touched
