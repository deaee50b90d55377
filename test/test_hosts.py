"""Run driver and planner on two hosts, measure the traffic on their link, and unplug the cable between them.

Run these tests with `make hosts`, which sets TACTILE_LONG. The hosts find each other by address and by a discovery
server. test_link.py runs without TACTILE_LONG. two_hosts.py provides the link and the hosts.
"""

import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest
from can_bench import TooSlowError
from hosts_bench import HostsWorld, cut_and_mend, held, missing, use_from_other_host, withdrawn
from misled_bench import FalseClaim, current, empty
from two_hosts import Hosts, NoHostsError

from tactile_node.ros.source_guard import SOURCE_HOLD

pytestmark = [pytest.mark.ros, pytest.mark.bus, pytest.mark.long]

PERIOD = 0.08  # Time between two frames [s], long enough for a busy machine.
TAXELS = 256
VALUE_BYTES = 4  # Bytes per taxel in TaxelArray.
FRAMES = 20
RIVAL = Path(__file__).with_name('rival_driver.py')
WAYS = [False, True]  # True selects a discovery server, False static addresses.


def name_of(has_server: bool) -> str:
    return 'discovery_server' if has_server else 'static_peers'


on_both_ways = pytest.mark.parametrize('world', WAYS, ids=name_of, indirect=True, scope='module')


@pytest.fixture(scope='module')
def world(request) -> Iterator[HostsWorld]:
    try:
        with Hosts() as hosts, HostsWorld(hosts, period=PERIOD, here=('taxels=left/taxels',),
                                          discovery_server=request.param) as found:
            found.has_server = request.param
            yield found
    except NoHostsError as error:
        # pytest prints this warning even if it does not print the reasons for skipped tests.
        warnings.warn(f'NOT TESTED on two hosts: {error}', stacklevel=1)
        pytest.skip(f'NOT TESTED on two hosts: {error}')


@on_both_ways
def test_every_frame_arrives_as_the_shape_or_is_counted(world):
    def skipped() -> int:
        return sum(world.skipped(f'/left/{role}') for role in ('processor', 'classifier'))
    world.hold(0.0)
    since, octets, reported = time.monotonic(), world.hosts.octets(), skipped()
    world.wait(lambda: len(world.received('left', since)) > FRAMES, 'shapes')
    latest_sent = world.here_records[-1]['sequence']
    world.wait(lambda: world.latest('left')['sequence'] >= latest_sent, 'the shape of the latest frame')
    shapes = world.received('left', since)
    # A busy machine reads some TPDOs too late for their sweep, and the taxels of these TPDOs are then hidden.
    assert {seen(shape) for shape in shapes} <= {('SQUARE', 'NOT_UNKNOWN'), ('UNKNOWN', 'NOT_SEEN')}
    if not any(seen(shape) == ('SQUARE', 'NOT_UNKNOWN') for shape in shapes):
        raise world.failure('no shape of all was seen whole')
    # The data of both pads must cross the link, and must not pass through shared memory or another network.
    assert world.hosts.octets() - octets > 2 * TAXELS * VALUE_BYTES * (len(shapes) - 3)
    world.wait(lambda: skipped() - reported >= missing(shapes), 'what is missing to be counted')


def seen(record) -> tuple[str, str]:
    return record['shape'], record['reason']


def is_new(record) -> bool:
    """Return True if the age of the record on arrival is within the limit.

    The age includes all delays between the hosts.
    """
    return record['age'] is not None and record['age'] <= withdrawn(PERIOD) + PERIOD


@on_both_ways
def test_a_pulled_cable_misleads_no_consumer(world):
    lasting = cut_and_mend(world, lambda: world.hosts.plug(False), lambda: world.hosts.plug(True))
    assert lasting.holds, lasting


@on_both_ways
def test_a_reader_that_stops_holds_up_no_driver(world):
    """All nodes of the other host are stopped while the object is removed.

    One message may be delayed after the node has marked it fresh and before it is sent. The age of this message tells
    its reader that the message is old.
    """
    world.hold()
    thinking = world.bringups['thinking'].pid
    os.kill(thinking, signal.SIGSTOP)
    try:
        waits = world.driver_waits(2.0)
        world.skin.set(is_there=False)
        waits += world.driver_waits(1.0)
        looked = time.monotonic()
        world.wait(lambda: world.here_records[-1]['time'] > looked, 'the driver to go on')
    finally:
        back = time.monotonic()
        os.kill(thinking, signal.SIGCONT)
    try:
        world.wait_for_no_contact()
        claims = [record for record in world.received('grasp', back) if held(record)]
        assert len(claims) <= 1 and not any(map(is_new, claims)), claims
    finally:
        world.skin.set(is_there=True)
    assert not waits
    world.hold_again(time.monotonic())


@on_both_ways
def test_services_actions_and_reports_reach_the_other_host(world):
    use_from_other_host(world)


@on_both_ways
def test_a_driver_of_the_same_name_on_another_host_is_not_used(world):
    """A second driver may belong to another robot in the same domain.

    The second driver's pads are empty, while our pads hold an object.
    """
    def dropped() -> int:
        return int(world.values['/left/processor']['dropped_other_source'])
    world.hold()
    before = dropped()
    with world.on_second([sys.executable, str(RIVAL), str(PERIOD)], stdout=subprocess.PIPE, text=True) as rival:
        try:
            assert rival.stdout.readline() == 'ready\n'
            since = time.monotonic()
            world.wait(lambda: dropped() > before, 'the other driver to be seen')
            world.wait(lambda: not current(world.latest('grasp')), 'no grasp to be current')
            time.sleep(1.0)
            finding = world.false(FalseClaim('empty', empty), since)
            # If this machine delays our driver for long enough while the other driver starts, our driver looks
            # restarted.
            if finding.stall < SOURCE_HOLD:
                assert finding.seconds == 0
            elif finding.seconds:
                raise TooSlowError(f'the machine did not run for {finding.stall:.2f} s, and "empty" was claimed')
            world.wait(lambda: 'SEVERAL_PUBLISHERS' in world.values['/left/processor']['faults'], 'the fault')
            # With a discovery server, a driver knows only the participants that read one of its topics.
            if not world.has_server:
                world.wait(lambda: world.values['/skin_driver: left']['other_publishers'], 'the driver to see it')
        finally:
            rival.kill()
    world.hold_again(time.monotonic())


@pytest.mark.parametrize('side', ['thinking', 'bus'])
@on_both_ways
def test_a_side_that_is_killed_and_started_again_is_found(world, side):
    world.hold()
    world.end(side, is_killed=True)
    since = time.monotonic()
    findings = world.watch(since, 1.0, FalseClaim('empty', empty))
    world.start(side)
    world.hold_again(time.monotonic())
    assert findings[0].seconds == 0
    assert world.received('status', 0.0)[-1]['active']
