"""What a bad link does to the chain: each case makes one world bad, and gives a row of a table.

`python test/link_catalogue.py` (`make hosts`) runs every case and prints the tables of docs/hosts.md; `test_link.py`
runs a short one.
"""

import argparse
import itertools
import os
import signal
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import NamedTuple

from link_bench import MAX_AGE, ROOT, SPLITS, LinkWorld, Passed, passed
from misled_bench import FalseClaim, Record, current, empty
from misled_skin import PADS

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
NO_WAIT = 'the driver never waits for the link'
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


class Table:
    """Prints rows of Markdown as they come, and counts those that break a requirement."""

    def __init__(self, *names: str):
        self.wrong = 0
        print('\n| ' + ' | '.join(names) + ' |\n|' + ' --- |' * len(names), flush=True)

    def row(self, *values: object, requires: Mapping[str, bool]) -> None:
        """``requires``: what holds, or is broken, by its name."""
        broken = [name for name, holds in requires.items() if not holds]
        self.wrong += bool(broken)
        texts = [f'{value:.2f}' if isinstance(value, float) else str(value) for value in values]
        print('| ' + ' | '.join(texts) + ' |' + (f' **fails**: {", ".join(broken)}' if broken else ''), flush=True)


def common(found: Passed) -> dict[str, bool]:
    """Return what is required on every link."""
    return {'every frame came or is seen to be missing': not found.unnoticed, NO_WAIT: not found.waits}


def table_of_losses(splits: Sequence[str], period: float, seconds: float) -> int:
    table = Table('the link carries', 'messages', 'the link', 'sent', 'shapes', 'left out', 'missed', 'p50 [ms]',
                  'p99 [ms]', 'grasp known', 'believed empty [s]', 'believed held [s]', 'SYNC gap [s]')
    for split, best_effort in itertools.product(splits, (False, True)):
        with LinkWorld(split, period=period, parameters={'best_effort': best_effort}) as world:
            world.hold()
            for name, link in LINKS.items():
                found = lossy(world, link, seconds)
                of = found.passed
                is_counted = of.missed <= found.counted or split == 'grasps'  # there the consumer sees the gap
                table.row(split, 'best effort' if best_effort else 'reliable', name, of.sent, of.received, of.left_out,
                          of.missed, 1e3 * of.median, 1e3 * of.late, f'{of.known:.0%}', found.empty, found.touched,
                          of.sync_gap, requires=common(of) | {
                              'missed frames are counted': is_counted, 'never believed empty': not found.empty,
                              f'believed held for less than {TAKEN_AWAY / 2} s': found.touched < TAKEN_AWAY / 2})
    return table.wrong


def table_of_cuts(splits: Sequence[str], period: float) -> int:
    table = Table('the link carries', 'Fast DDS', 'cut [s]', 'recovered [s]', 'believed what was before it [s]',
                  'the latest message said fresh [s]', 'then believed held [s]', 'missed', 'counted by status',
                  'SYNC gap [s]', 'driver grows [kB/min]')
    for split, profile in itertools.product(splits, (None, PROFILE)):
        with LinkWorld(split, period=period, profile=profile, parameters={'best_effort': True}) as world:
            world.hold()
            for seconds in CUTS:
                found = cut(world, seconds, LINKS['20 ms ± 10 ms'])
                limit = RECOVERED if seconds < LEASE else RECOVERED_AFTER_LEASE
                table.row(split, 'as it is' if profile is None else profile.name, seconds, found.recovered,
                          found.current, found.latest, found.touched, found.passed.missed, found.counted,
                          found.passed.sync_gap, found.growth, requires=common(found.passed) | {
                              f'recovered within {limit} s': found.recovered < limit,
                              f'what was before it is believed for less than {MAX_AGE} s': found.current < MAX_AGE,
                              'then never believed held': not found.touched})
    return table.wrong


def table_of_readers(period: float) -> int:
    table = Table('reader that stops', 'for [s]', 'recovered [s]', 'then believed held [s]', 'SYNC gap [s]',
                  'longest time without taxels beside the driver [s]', 'driver grows [kB/min]')
    with LinkWorld(period=period) as world:
        world.hold()
        beside = world.consume(world.link.first, {'stopped': 'left/taxels'})
        world.consume(world.link.second, {'slow': 'left/taxels'})
        time.sleep(WARM)  # what Python and DDS take for the first messages is taken
        for name, process in (('consumer beside the driver', beside), ('consumer on the other host', world.consumer),
                              ('processing on the other host', world.thinking)):
            found = stopped(world, process.pid, STOP)
            table.row(name, STOP, found.recovered, found.touched, found.passed.sync_gap, found.passed.published_gap,
                      found.growth, requires={
                          'then never believed held': not found.touched, NO_WAIT: not found.passed.waits,
                          f'the driver grows by less than {FLAT:.0f} kB a minute': found.growth < FLAT})
    return table.wrong


def table_of_rates(period: float, seconds: float) -> int:
    """What the profile is for; as it is the driver may wait for the link."""
    table = Table('Fast DDS', 'rate', 'sent', 'expected', 'SYNC gap [s]',
                  'longest time without taxels beside the driver [s]', 'seen to wait [times in 10 s]')
    for profile in (None, PROFILE):
        with LinkWorld(period=period, profile=profile, parameters={'best_effort': True}) as world:
            world.hold()
            for rate in RATES:
                found = slow(world, rate, seconds)
                table.row('as it is' if profile is None else profile.name, rate, found.sent,
                          round(len(PADS) * seconds / period), found.sync_gap, found.published_gap,
                          10 * found.waits / seconds, requires={NO_WAIT: profile is None or not found.waits})
    return table.wrong


def main(words: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('tables', nargs='*', default=['losses', 'cuts', 'readers', 'rates'])
    parser.add_argument('--split', nargs='+', default=list(SPLITS), help='what the link carries')
    parser.add_argument('--period', type=float, default=0.04, help='time between two frames [s]')
    parser.add_argument('--seconds', type=float, default=20.0, help='on each link')
    args = parser.parse_args(words)
    tables = {'losses': partial(table_of_losses, args.split, args.period, args.seconds),
              'cuts': partial(table_of_cuts, args.split, args.period),
              'readers': partial(table_of_readers, args.period),
              'rates': partial(table_of_rates, args.period, args.seconds)}
    wrong = sum(tables[name]() for name in args.tables)
    print(f'\n{wrong} rows break a requirement' if wrong else '\nAll requirements hold.')
    return int(wrong > 0)


if __name__ == '__main__':
    sys.exit(main())
