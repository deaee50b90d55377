"""Driver and planner on two hosts: what crosses the link, what a consumer sees when the cable is pulled; `make hosts`.

The hosts find each other by address; those of test_link.py do so by a discovery server. With TACTILE_LONG there is a
world for each way, each side is started again, and durations are asserted. Link and hosts are those of two_hosts.py.
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
from hosts_bench import HostsWorld, missing, use_from_other_host
from misled_bench import FalseClaim, current, empty
from two_hosts import Hosts, NoHostsError

from tactile_node.ros.source_guard import SOURCE_HOLD

pytestmark = [pytest.mark.ros, pytest.mark.bus]

LONG = bool(os.environ.get('TACTILE_LONG'))
PERIOD = 0.08  # s between two frames: a busy machine keeps up
WITHDRAWN = max(0.1, 3 * PERIOD)  # s in which freshness must be withdrawn
TAXELS = 256
VALUE_BYTES = 4  # of a taxel in TaxelArray
FRAMES = 20
RIVAL = Path(__file__).with_name('rival_driver.py')
WAYS = [False, True]  # with a discovery server


def name_of(has_server: bool) -> str:
    return 'discovery_server' if has_server else 'static_peers'


first_way = pytest.mark.parametrize('world', WAYS if LONG else WAYS[:1], ids=name_of, indirect=True, scope='module')


@pytest.fixture(scope='module')
def world(request) -> Iterator[HostsWorld]:
    try:
        with Hosts() as hosts, HostsWorld(hosts, period=PERIOD, here=('taxels=left/taxels',),
                                          discovery_server=request.param) as found:
            found.has_server = request.param
            yield found
    except NoHostsError as error:
        warnings.warn(f'NOT TESTED on two hosts: {error}', stacklevel=1)  # pytest shows it also where skips are not
        pytest.skip(f'NOT TESTED on two hosts: {error}')


def test_a_machine_without_namespaces_is_recognised(monkeypatch):
    monkeypatch.setenv('PATH', '/nowhere')
    with pytest.raises(NoHostsError), Hosts():
        pass


@first_way
def test_every_frame_arrives_as_the_shape_or_is_counted(world):
    def skipped() -> int:
        return sum(world.skipped(f'/left/{role}') for role in ('processor', 'classifier'))
    world.hold(0.0)
    since, octets, reported = time.monotonic(), world.hosts.octets(), skipped()
    world.wait(lambda: len(world.received('left', since)) > FRAMES, 'shapes')
    latest_sent = world.here_records[-1]['sequence']
    world.wait(lambda: world.latest('left')['sequence'] >= latest_sent, 'the shape of the latest frame')
    shapes = world.received('left', since)
    # A busy machine reads some TPDOs too late for their sweep; their taxels are then hidden
    assert {seen(shape) for shape in shapes} <= {('SQUARE', 'NOT_UNKNOWN'), ('UNKNOWN', 'NOT_SEEN')}
    if not any(seen(shape) == ('SQUARE', 'NOT_UNKNOWN') for shape in shapes):
        raise world.failure('no shape of all was seen whole')
    # both pads: by the link, not by shared memory or another network
    assert world.hosts.octets() - octets > 2 * TAXELS * VALUE_BYTES * (len(shapes) - 3)
    world.wait(lambda: skipped() - reported >= missing(shapes), 'what is missing to be counted')


def seen(record) -> tuple[str, str]:
    return record['shape'], record['reason']


def held(record) -> bool:
    """Whether it says that something is held now."""
    return current(record) and record['contact'] in ('ONE_SIDED', 'TWO_SIDED')


def is_new(record) -> bool:
    """Whether its reader finds it to be of now: by its age on arrival, which counts what held it back on its way."""
    return record['age'] is not None and record['age'] <= WITHDRAWN + PERIOD


def wait_for_no_contact(world) -> None:
    world.wait(lambda: world.latest('grasp')['contact'] == 'NO_CONTACT' and current(world.latest('grasp')),
               'an empty gripper')


@first_way
def test_a_pulled_cable_misleads_no_consumer(world):
    """Nor does what was under way when it was pulled, once it is back: the object is taken away meanwhile."""
    world.hold()
    world.hosts.plug(False)
    try:
        findings = world.watch(time.monotonic(), 1.0, FalseClaim('empty', empty),
                               FalseClaim('current', current, WITHDRAWN + PERIOD))
        world.skin.set(is_there=False)
        time.sleep(1.0)
    finally:
        back = time.monotonic()
        world.hosts.plug(True)
    lasting = next(finding for finding in findings if finding.claim == 'current')
    assert findings[0].seconds == 0
    assert lasting.has_ended and (lasting.holds or not LONG), lasting
    try:
        wait_for_no_contact(world)
        assert world.false(FalseClaim('held', held), back).seconds == 0
        assert {world.latest(side)['shape'] for side in ('left', 'right')} == {'NONE'}
    finally:
        world.skin.set(is_there=True)
    world.hold_again(time.monotonic())


@first_way
def test_a_reader_that_stops_holds_up_no_driver(world):
    """All nodes of the other host stand still while the object is taken away.

    One message may stand between its decision and its sending: it says fresh, and its reader finds it to be old.
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
        wait_for_no_contact(world)
        claims = [record for record in world.received('grasp', back) if held(record)]
        assert len(claims) <= 1 and not any(map(is_new, claims)), claims
    finally:
        world.skin.set(is_there=True)
    assert not waits
    world.hold_again(time.monotonic())


@pytest.mark.skipif(not LONG, reason='TACTILE_LONG is not set: test_link.py has it')
@first_way
def test_services_actions_and_reports_reach_the_other_host(world):
    use_from_other_host(world)


@first_way
def test_a_driver_of_the_same_name_on_another_host_is_not_believed(world):
    """Of another robot in the same domain, say: its pads are empty, and ours hold an object."""
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
            # A driver that this machine holds up so long as the other one begins looks like one that was started again
            if finding.stall < SOURCE_HOLD:
                assert finding.seconds == 0
            elif finding.seconds:
                raise TooSlowError(f'the machine did not run for {finding.stall:.2f} s, and "empty" was claimed')
            world.wait(lambda: 'SEVERAL_PUBLISHERS' in world.values['/left/processor']['faults'], 'the fault')
            if not world.has_server:  # by the server a driver knows only who shares a topic with it as a reader
                world.wait(lambda: world.values['/skin_driver: left']['other_publishers'], 'the driver to see it')
        finally:
            rival.kill()
    world.hold_again(time.monotonic())


@pytest.mark.skipif(not LONG, reason='TACTILE_LONG is not set: 10 s')
@pytest.mark.parametrize('side', ['thinking', 'bus'])
@first_way
def test_a_side_that_is_killed_and_started_again_is_found(world, side):
    world.hold()
    world.end(side, is_killed=True)
    since = time.monotonic()
    findings = world.watch(since, 1.0, FalseClaim('empty', empty))
    world.start(side)
    world.hold_again(time.monotonic())
    assert findings[0].seconds == 0
    assert world.received('status', 0.0)[-1]['active']
