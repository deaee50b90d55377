"""Driver and planner on two hosts: what crosses the link, what a consumer sees when the cable is pulled; `make hosts`.

The short form has one world of each split, each with another way of discovery; with TACTILE_LONG every pair of them,
and each side is started late and again. Link, discovery and shared memory are those of two_hosts.py.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')

from hosts_bench import HostsWorld, Split  # noqa: E402
from misled_bench import WITHDRAWN, FalseClaim, current, empty  # noqa: E402
from two_hosts import Hosts, NoHostsError  # noqa: E402

pytestmark = [pytest.mark.ros, pytest.mark.bus]

LONG = bool(os.environ.get('TACTILE_LONG'))
PERIOD = 0.05  # s between two frames: a busy machine keeps up
TAXELS = 256
VALUE_BYTES = 4  # of a taxel in TaxelArray
CLIENT = Path(__file__).with_name('hosts_client.py')
WAYS = [(Split.TAXELS, False), (Split.CONTACTS, True)]
if LONG:
    WAYS += [(Split.TAXELS, True), (Split.CONTACTS, False)]


def name_of(way) -> str:
    split, has_server = way
    return f'{split.name.lower()}-{"discovery_server" if has_server else "static_peers"}'


@pytest.fixture(scope='module', params=WAYS, ids=name_of)
def world(request) -> Iterator[HostsWorld]:
    split, has_server = request.param
    try:
        with Hosts() as hosts, HostsWorld(hosts, split, period=PERIOD, here=('taxels=left/taxels',),
                                          discovery_server=has_server) as found:
            found.split = split
            yield found
    except NoHostsError as error:
        pytest.skip(f'NOT TESTED on two hosts: {error}')


def missing(shapes) -> int:
    """Frames between these that neither came nor were left out on purpose."""
    return sum(max(0, after['sequence'] - before['sequence'] - 1 - after['left_out'])
               for before, after in zip(shapes, shapes[1:]))


def test_every_frame_arrives_as_the_shape_or_is_counted(world):
    world.hold(0.0)
    since, octets, reported = time.monotonic(), world.hosts.octets(), world.skipped('/left/processor')
    time.sleep(2.0)
    shapes = world.received('left', since)
    assert {shape['shape'] for shape in shapes} == {'SQUARE'}
    assert missing(shapes) <= world.skipped('/left/processor') - reported
    sent = [record for record in world.here_records if record['time'] > since]
    assert sent[-1]['sequence'] - 3 <= shapes[-1]['sequence'] + missing(shapes) <= sent[-1]['sequence'] + 3
    if world.split is Split.TAXELS:  # both pads: by the link, not by shared memory or another network
        assert world.hosts.octets() - octets > 2 * TAXELS * VALUE_BYTES * (len(shapes) - 3)


def test_a_pulled_cable_misleads_no_consumer(world):
    world.hold()
    world.hosts.plug(False)
    try:
        findings = world.watch(time.monotonic(), 1.0, FalseClaim('empty', empty),
                               FalseClaim('current', current, WITHDRAWN + PERIOD))
    finally:
        world.hosts.plug(True)
    lasting = next(finding for finding in findings if finding.claim == 'current')
    assert findings[0].seconds == 0
    assert lasting.has_ended and lasting.holds, lasting
    world.hold_again(time.monotonic())


def test_an_object_that_is_taken_away_is_gone(world):
    world.hold()
    world.skin.set(is_there=False)
    try:
        world.wait(lambda: world.latest('grasp')['contact'] == 'NO_CONTACT', 'an empty gripper')
        assert {world.latest(side)['shape'] for side in ('left', 'right')} == {'NONE'}
    finally:
        world.skin.set(is_there=True)


def test_services_and_actions_answer_on_the_other_host(world):
    """check_grasp is asked where the grasp node runs, tare crosses the link."""
    world.hold(0.0)
    with world.on_second([sys.executable, str(CLIENT)], stdout=subprocess.PIPE, text=True) as client:
        answer = json.loads(client.communicate(timeout=60)[0])
    assert answer['check'] == answer['waited'] == answer['held']
    assert answer['tare_refusal'] in (answer['contact'], answer['pressed'])


@pytest.mark.parametrize('side', ['thinking', 'bus'] if LONG else ['thinking'])
def test_a_side_that_is_killed_and_started_again_is_found(world, side):
    world.hold()
    world.end(side, is_killed=True)
    since = time.monotonic()
    findings = world.watch(since, 1.0, FalseClaim('empty', empty))
    world.start(side)
    world.hold_again(time.monotonic())
    assert findings[0].seconds == 0
    assert world.received('status', 0.0)[-1]['active']
