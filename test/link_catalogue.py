"""What a bad link between driver and planner does to a consumer on the planner's host.

`python test/link_catalogue.py` (part of `make hosts`) makes the link bad in each way, for both splits of the nodes, and
prints what arrived, what the nodes reported as missed, for how long the latest message was false, how long the driver
paused at most, and how soon all was well again. `test_link.py` runs some of it.
"""

import argparse
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from hosts_bench import HostsWorld, Split
from misled_bench import PERIOD, WITHDRAWN, FalseClaim, Finding, Record, current, empty, negated, stable
from two_hosts import LossyHosts

HERE = ('taxels=left/taxels', 'status=skin_driver/status')
SETTLE = 1.0   # s after the link has become bad
WHILE = 10.0   # s of a steady bad link
DRIVER_PAUSE = 0.25  # s at most between two taxel frames on the driver's host: what a blocked driver would exceed
MEMORY = 2.0   # MB a minute at most
REST = 20.0    # s for which memory has to settle before it is compared


class Row(NamedTuple):
    """One kind of link; times in s. NaN: does not apply."""

    link: str
    split: Split
    sent: int           #: taxel frames of the left pad, on the driver's host
    arrived: int        #: as shapes at the consumer
    left_out: int       #: on purpose, for newer ones, as the shapes say
    reported: int       #: as skipped or dropped, by the nodes behind the link
    p50: float          #: from the acquisition to the consumer
    p99: float
    pause: float        #: the longest between two frames of the driver, on its host
    stalled: float      #: for how long this machine stood still at most
    memory: float       #: growth of the driver's process [MB a minute]
    recovery: float     #: from the return of the link to a stable grasp
    allowed: float      #: for that
    findings: tuple[Finding, ...]

    @property
    def unreported(self) -> int:
        """Frames that did not come, were not left out, and that no node has counted; the last ones are on their way."""
        return self.sent - self.arrived - self.left_out - self.reported

    @property
    def faults(self) -> list[str]:
        """What is not as it has to be."""
        found = [f'{finding.claim} for {finding.seconds:.2f} s' for finding in self.findings if not finding.holds]
        if self.pause > DRIVER_PAUSE + self.stalled:
            found.append(f'the driver paused for {self.pause:.2f} s')
        if self.unreported > ON_THE_WAY:
            found.append(f'{self.unreported} frames lost in silence')
        if self.recovery > self.allowed + self.stalled:
            found.append(f'recovered after {self.recovery:.2f} s')
        if self.memory > MEMORY:
            found.append(f'memory grows by {self.memory:.1f} MB a minute')
        return found

    def cells(self) -> list[str]:
        times = [f'{1e3 * each:.0f}' for each in (self.p50, self.p99, self.pause)]
        misled = ', '.join(f'{finding.claim} {finding.seconds:.2f} ({finding.bound:.2f})' for finding in self.findings)
        optional = [f'{each:.2f}' if np.isfinite(each) else '' for each in (self.recovery, self.memory)]
        return [self.link, self.split.name.lower(), str(self.sent), str(self.arrived), str(self.left_out),
                str(self.reported), *times, misled, *optional]


HEADER = ('link', 'what crosses it', 'frames sent', 'shapes', 'left out', 'reported missed', 'p50 [ms]', 'p99 [ms]',
          'longest pause of the driver [ms]', 'misled [s] (allowed)', 'recovered after [s]', 'memory [MB/min]')
ON_THE_WAY = 8  # frames that may be in processes and queues when counts are compared


class Watched:
    """Counts what happened in a world since it was made; made while all is well."""

    def __init__(self, world: HostsWorld):
        self._world = world
        self._since = time.monotonic()
        self._reported = self._count()
        self._began = (time.monotonic(), world.memory('bus'))

    def row(self, link: str, split: Split, findings: Sequence[Finding], recovery: float = np.nan,
            allowed: float = np.inf) -> Row:
        """Wait for the reports of the nodes, which come once a second, and sum up."""
        until = time.monotonic()
        elapsed = (until - self._began[0]) / 60
        growth = (self._world.memory('bus') - self._began[1]) / elapsed if elapsed > 1 else np.nan
        time.sleep(1.5)
        shapes = self._within(self._world.records, 'left', until)
        taxels = self._within(self._world.here_records, 'taxels', until)
        latency = [shape['latency'] for shape in shapes] or [np.nan]
        stalls = [length for begin, length in list(self._world.stalls) if begin + length >= self._since]
        return Row(link, split, _span(taxels), len(shapes), sum(shape['left_out'] for shape in shapes),
                   self._count() - self._reported, *np.percentile(latency, (50, 99)), _longest(taxels),
                   max(stalls, default=0.0), growth, recovery, allowed, tuple(findings))

    def _within(self, records: list[Record], topic: str, until: float) -> list[Record]:
        return [record for record in list(records)
                if record['topic'] == topic and self._since < record['time'] <= until]

    def _count(self) -> int:
        return sum(self._world.skipped(node) for node in ('/left/processor', '/left/classifier'))


def _span(records: Sequence[Record]) -> int:
    """Frames from the first to the last of these, the ones between included."""
    return records[-1]['sequence'] - records[0]['sequence'] + 1 if records else 0


def _longest(records: Sequence[Record]) -> float:
    return max((after['time'] - before['time'] for before, after in zip(records, records[1:])), default=np.nan)


def steadily(world: HostsWorld, split: Split, name: str, seconds: float = WHILE, **link: float) -> Row:
    """The link is bad all the time, and the object is held: nothing is ever empty."""
    world.hold()
    watched = Watched(world)
    world.hosts.set(**link)
    since = time.monotonic()
    time.sleep(SETTLE)
    findings = world.watch(since, seconds, FalseClaim('empty', empty), FalseClaim('left empty', empty, topic='left'))
    unstable = world.false(FalseClaim('not stable', negated(stable), np.inf), since)
    row = watched.row(name, split, [*findings, unstable])
    world.hosts.set()
    world.hold_again(time.monotonic())
    return row


def cut(world: HostsWorld, split: Split, seconds: float, allowed: float) -> Row:
    """Nothing passes for ``seconds``: the latest grasp is withdrawn, and comes again."""
    world.hold()
    watched = Watched(world)
    world.hosts.plug(False)
    since = time.monotonic()
    findings = world.watch(since, seconds, FalseClaim('empty', empty),
                           FalseClaim('current', current, WITHDRAWN + PERIOD))
    back = time.monotonic()
    world.hosts.plug(True)
    recovery = world.hold_again(back)
    after = world.false(FalseClaim('empty after', empty), back)
    return watched.row(f'cut for {seconds:.0f} s', split, [*findings, after], recovery, allowed)


def emptied_while_cut(world: HostsWorld, split: Split, seconds: float) -> Row:
    """The object is taken away meanwhile: what comes after the cut must not say that it is held."""
    world.hold()
    watched = Watched(world)
    world.hosts.plug(False)
    time.sleep(seconds / 2)
    world.skin.set(is_there=False)
    time.sleep(seconds / 2)
    back = time.monotonic()
    world.hosts.plug(True)
    world.wait(lambda: [each for each in world.received('grasp', back) if each['contact'] == 'NO_CONTACT'], 'empty')
    held = world.false(FalseClaim('held', _says_held), back)
    world.skin.set(is_there=True)
    row = watched.row(f'cut for {seconds:.0f} s, object taken away', split, [held])
    world.hold_again(time.monotonic())
    return row


def _says_held(record: Record) -> bool:
    return record['contact'] in ('TWO_SIDED', 'ONE_SIDED') and current(record)


@contextmanager
def stopped_reader(world: HostsWorld):
    """A second planner that has subscribed to everything and stops reading, as one in a debugger does."""
    reader, _ = world.another_consumer('grasp=grasp', 'left=left/shape', 'taxels=left/taxels')
    time.sleep(1.0)
    reader.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        reader.send_signal(signal.SIGCONT)


def reader_stops(world: HostsWorld, split: Split, seconds: float) -> Row:
    """The first planner goes on as before, the driver does not wait, and memory is flat."""
    world.hold()
    with stopped_reader(world):
        time.sleep(min(REST, seconds))
        watched = Watched(world)
        since = time.monotonic()
        findings = world.watch(since, seconds, FalseClaim('empty', empty))
        unstable = world.false(FalseClaim('not stable', negated(stable), np.inf), since)
        return watched.row(f'a reader stops for {min(REST, seconds) + seconds:.0f} s', split, [*findings, unstable])


CASES: tuple[tuple[str, Callable[..., Row], dict[str, Any]], ...] = (
    ('good', steadily, {'name': 'good'}),
    ('loss1', steadily, {'name': '1 % lost', 'loss': 0.01}),
    ('loss5', steadily, {'name': '5 % lost', 'loss': 0.05}),
    ('bursts', steadily, {'name': '5 % lost in bursts of 5', 'loss': 0.05, 'burst': 5.0}),
    ('delay', steadily, {'name': '20 ms late, 10 ms more or less', 'delay': 0.02, 'jitter': 0.01}),
    ('both', steadily, {'name': 'the same and 5 % lost', 'loss': 0.05, 'delay': 0.02, 'jitter': 0.01}),
    ('cut5', cut, {'seconds': 5.0, 'allowed': 1.0}),
    ('emptied', emptied_while_cut, {'seconds': 5.0}),
    ('reader', reader_stops, {'seconds': 90.0}),
    ('cut60', cut, {'seconds': 60.0, 'allowed': 5.0}))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--only', default='', help='cases, comma-separated: ' + ', '.join(name for name, _, _ in CASES))
    args = parser.parse_args()
    chosen = args.only.split(',') if args.only else [name for name, _, _ in CASES]
    print('| ' + ' | '.join(HEADER) + ' |\n|' + ' --- |' * len(HEADER))
    wrong = 0
    for split in Split:
        with LossyHosts() as hosts, HostsWorld(hosts, split, here=HERE) as world:
            world.hold()
            for name, case, parameters in CASES:
                if name in chosen:
                    row = case(world, split, **parameters)
                    wrong += bool(row.faults)
                    print('| ' + ' | '.join(row.cells()) + ' |' + (f' **{", ".join(row.faults)}**' if row.faults
                                                                   else ''), flush=True)
    print(f'\n{wrong} links did what they must not' if wrong else '\nNo consumer was misled, nothing lost in silence.')
    return int(wrong > 0)


if __name__ == '__main__':
    sys.exit(main())
