"""Run the chain on two hosts joined by a poor link.

No consumer believes a false state, and every loss is reported.

The hosts find each other through a discovery server, or by address with TACTILE_LONG. test_hosts.py uses a link without
losses, and only with TACTILE_LONG.
"""

import json
import os
import time
import warnings
from pathlib import Path

import pytest
from hosts_bench import TOPICS, HostsWorld, cut_and_mend, missing, use_from_other_host
from misled_bench import FalseClaim, empty
from two_hosts import LossyHosts, NoHostsError

pytestmark = [pytest.mark.ros, pytest.mark.bus]

LONG = bool(os.environ.get('TACTILE_LONG'))
FRAME_PERIOD = 0.08  # Time between two frames [s], long enough for a busy machine.
LOOK_SECONDS = 3.0
#: Data rate of the link, well below the rate that the taxels need even if a busy machine sends every frame late.
LINK_RATE = '50kbit'
#: Number of bytes that Linux allows for the waiting packets of a socket. Kernel headers are about half of these bytes.
SOCKET_ROOM = int(Path('/proc/sys/net/core/wmem_default').read_text(encoding='ascii'))
DDS_PROFILE = Path(__file__).resolve().parents[1] / 'examples' / 'fastdds_link.xml'
#: With LOCALHOST, rmw_fastrtps uses another transport, whatever the profile says.
HOST_ENVIRONMENT = {'FASTRTPS_DEFAULT_PROFILES_FILE': str(DDS_PROFILE), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}


@pytest.fixture(scope='module')
def world():
    try:
        with LossyHosts() as hosts, HostsWorld(hosts, topics=(*TOPICS, '--best-effort'), period=FRAME_PERIOD,
                                               discovery_server=not LONG, environment=HOST_ENVIRONMENT,
                                               given=('best_effort:=true',)) as found:
            found.hold()
            yield found
    except NoHostsError as error:
        # pytest prints this warning even if it does not print the reasons for skipped tests.
        warnings.warn(f'NOT TESTED on two hosts: {error}', stacklevel=1)
        pytest.skip(f'NOT TESTED on two hosts: {error}')


def test_a_machine_without_namespaces_is_recognised(monkeypatch):
    monkeypatch.setenv('PATH', '/nowhere')
    with pytest.raises(NoHostsError), LossyHosts():
        pass


def test_services_actions_and_reports_reach_the_other_host(world):
    use_from_other_host(world)


def missed_since(world, since) -> int:
    return sum(missing(world.received(pad, since)) for pad in ('left', 'right'))


def test_a_link_that_loses_and_delays(world):
    """Missed frames leave gaps in the sequence, and the subscriber counts them.

    No consumer believes a false state, even after the object is removed.
    """
    before, since = world.skipped('/grasp'), time.monotonic()
    world.hosts.set(loss=0.05, delay=0.02, jitter=0.01)
    try:
        waits = world.driver_waits(LOOK_SECONDS)
        assert world.false(FalseClaim('empty', empty), since).seconds == 0
        world.skin.set(is_there=False)
        world.wait_for_no_contact()
        world.wait(lambda: missed_since(world, since), 'the link to lose a frame')
    finally:
        world.skin.set(is_there=True)
        world.hosts.set()
    missed = missed_since(world, since)
    assert not waits
    world.wait(lambda: world.skipped('/grasp') - before >= missed, 'what was missed to be counted')
    world.hold_again(time.monotonic())


def test_a_link_that_carries_nothing_misleads_no_consumer(world):
    cut_and_mend(world, lambda: world.hosts.set(loss=1.0), world.hosts.set)


def waiting_bytes(world) -> int:
    found = json.loads(world.hosts.first.run('tc', '-json', '-statistics', 'qdisc', 'show', 'dev', 'tun0'))
    return found[0]['backlog']


def test_a_link_that_carries_less_than_is_sent(world):
    """A full socket buffer must not delay the driver. Without the DDS profile, the driver is delayed."""
    shaped = 'tc', 'qdisc', 'replace', 'dev', 'tun0', 'root'
    try:
        world.hosts.first.run(*shaped, 'tbf', 'rate', LINK_RATE, 'burst', '10kb', 'latency', '20s')
    except NoHostsError as error:  # This kernel has no token bucket filter.
        pytest.skip(str(error))
    since = time.monotonic()
    world.wait(lambda: waiting_bytes(world) > SOCKET_ROOM / 3, 'the socket to be nearly full')
    waits = world.driver_waits(LOOK_SECONDS)
    world.hosts.first.run(*shaped, 'pfifo', 'limit', '1000')
    world.hold_again(time.monotonic())
    assert missing(world.received('left', since)) and not waits, 'the driver must not wait for the link'
