"""What a bad link does to the chain: each case makes one world bad, and gives what was measured; see test_link.py."""

import os
import signal
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from link_bench import ROOT, LinkWorld, Passed, passed
from misled_bench import FalseClaim, Record, current, empty

SETTLED = 1.0  # s until what is under way has arrived
TAKEN_AWAY = 1.0  # s for which the object is away
Link = Mapping[str, float]
LINKS: Mapping[str, Link] = {
    'good': {}, '20 ms ± 10 ms': {'delay': 0.02, 'jitter': 0.01}, '1 % lost': {'loss': 0.01},
    '5 % lost': {'loss': 0.05}, '5 % lost, in bursts of 5': {'loss': 0.05, 'burst': 5},
    '1 % lost, 20 ms ± 10 ms': {'loss': 0.01, 'delay': 0.02, 'jitter': 0.01},
    '5 % lost, 20 ms ± 10 ms': {'loss': 0.05, 'delay': 0.02, 'jitter': 0.01}}
CUTS = 5.0, 60.0  # s
STOP = 60.0  # s
WARM = 30.0  # s
RECOVERED, RECOVERED_AFTER_LEASE = 1.0, 5.0  # s from the end of a cut to a grasp that is fresh and true
LEASE = 20.0  # s, of a DDS participant
FLAT = 1000.0  # kB a minute, of a process of 140 MB
RATES = '500kbit', '200kbit'
PROFILE = ROOT / 'examples' / 'fastdds_link.xml'


def touched(record: Record) -> bool:
    return record['contact'] in ('ONE_SIDED', 'TWO_SIDED')


def two_sided(record: Record) -> bool:
    return record['contact'] == 'TWO_SIDED'


def no_contact(record: Record) -> bool:
    return record['contact'] == 'NO_CONTACT'


class Lossy(NamedTuple):
    """A link that loses packets or delays them."""

    passed: Passed
    empty: float      #: the planner believed that nothing is held while the object was [s]
    touched: float    #: that something is held after the object was taken away [s]
    counted: int      #: frames that the status of the grasp node reports as skipped meanwhile


class Cut(NamedTuple):
    """A link that was cut for some time, in which the object was taken away."""

    passed: Passed
    current: float    #: after the cut the planner believed what it had heard before it for so long [s]
    latest: float     #: for how long the latest message still said fresh or stable [s]
    touched: float    #: after the end of the cut it believed that something is held [s]
    recovered: float  #: from the end of the cut to the first grasp that was fresh and true [s]
    counted: int
    growth: float     #: of the driver's process during the cut [kB a minute]


class Stopped(NamedTuple):
    """A reader that stopped reading for some time, in which the object was taken away."""

    passed: Passed    #: of the driver and those that read on
    touched: float    #: after it went on, a planner believed that something is held [s]
    recovered: float  #: from then to the first grasp that was fresh and true [s]
    growth: float     #: of the driver's process meanwhile [kB a minute]


def lossy(world: LinkWorld, link: Link, seconds: float) -> Lossy:
    """``link`` for so long; then the object is taken away for a second."""
    with counting(world) as counted:
        world.link.set(**link)
        since = time.monotonic()
        time.sleep(seconds)
        world.skin.set(is_there=False)
        away = time.monotonic()
        time.sleep(TAKEN_AWAY)
        world.skin.set(is_there=True)
        until = time.monotonic()
        time.sleep(SETTLED)
        world.link.set()
    return Lossy(passed(world, since, until), world.believed(empty, since, away),
                 world.believed(touched, away, until), counted.pop())


def cut(world: LinkWorld, seconds: float, link: Link) -> Cut:
    """Nothing passes for so long."""
    world.link.set(**link)
    world.recovered(time.monotonic(), two_sided)
    time.sleep(SETTLED)
    with counting(world) as counted:
        world.link.set(is_cut=True)
        since = time.monotonic()
        time.sleep(seconds / 2)
        world.skin.set(is_there=False)
        time.sleep(seconds / 2)
        back = time.monotonic()
        latest = world.false(FalseClaim('current', current), since).seconds
        growth = world.growth(since + SETTLED)
        world.link.set(**link)
        recovered = world.recovered(back, no_contact)
        until = time.monotonic()
        world.skin.set(is_there=True)
        time.sleep(SETTLED)
        world.link.set()
    return Cut(passed(world, since, until), world.believed(current, since, back), latest,
               world.believed(touched, back, until), recovered, counted.pop(), growth)


def stopped(world: LinkWorld, pid: int, seconds: float) -> Stopped:
    """The process ``pid``, a reader, does not run for so long (SIGSTOP)."""
    world.recovered(time.monotonic(), two_sided)
    os.kill(pid, signal.SIGSTOP)
    since = time.monotonic()
    try:
        time.sleep(seconds / 2)
        world.skin.set(is_there=False)
        time.sleep(seconds / 2)
        growth = world.growth(since + SETTLED)
    finally:
        back = time.monotonic()
        os.kill(pid, signal.SIGCONT)
    recovered = world.recovered(back, no_contact)
    until = time.monotonic()
    world.skin.set(is_there=True)
    world.recovered(until, two_sided)
    return Stopped(passed(world, since, until), world.believed(touched, back, until), recovered, growth)


@contextmanager
def counting(world: LinkWorld) -> Iterator[list[int]]:
    """Gives a list to which the frames are added that the grasp node has reported as skipped within the block."""
    counted: list[int] = []
    before = world.status('/grasp').get('skipped', 0)
    yield counted
    world.wait_for_status('/grasp')
    counted.append(world.status('/grasp').get('skipped', 0) - before)


def slow(world: LinkWorld, rate: str, seconds: float) -> Passed:
    """The first host's end of the link carries no more than ``rate`` (tc-tbf(8)); all else is the driver's.

    Raises NoHostsError where the kernel has no token bucket.
    """
    shaped = 'tc', 'qdisc', 'replace', 'dev', 'tun0', 'root'
    world.link.first.run(*shaped, 'tbf', 'rate', rate, 'burst', '10kb', 'latency', '20s')
    since = time.monotonic()
    time.sleep(seconds)
    until = time.monotonic()
    world.link.first.run(*shaped, 'pfifo', 'limit', '1000')
    world.recovered(time.monotonic(), two_sided)
    return passed(world, since, until)
