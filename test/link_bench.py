"""The chain on two hosts that a bad link joins: the bus on the first, what thinks on the second, as a user starts them.

The skin holds an object. Consumers on both hosts print what they receive, by a clock that both hosts share.
"""

import json
import re
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from contextlib import ExitStack
from math import inf, nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from misled_bench import Claim, Record, SkinProcess, Watch
from misled_skin import LAYOUT, NODE_IDS, PADS
from two_hosts import Host, LossyHosts

from tactile_node.ros.message_age import NOT_KNOWN_SEC, DelayEstimator

ROOT = Path(__file__).resolve().parents[1]
CONSUMER = ROOT / 'test' / 'misled_consumer.py'
#: By what the link carries: whether the nodes are on both hosts, or all on that of the bus
SPLITS = {'taxels': True, 'grasps': False}
NEAR = {pad: f'near_{pad}' for pad in PADS}  # the taxels as a consumer beside the driver receives them
MAX_AGE, MAX_SILENCE = 0.3, 0.1  # s, as in docs/consumers.md and examples/planner_client.py
STATUS_PERIOD = 1.0  # s between two messages of a node about what it has received
LOOK_PERIOD = 0.1  # s between two looks at the driver's process
SENDING = 'sock_alloc_send'  # function of the kernel in which a thread waits for room in a socket


class LinkWorld(Watch):
    """``split``: what the link carries (SPLITS). ``period`` [s]: between two frames. A context; raises NoHostsError.

    Records of the second host: 'grasp', 'left', 'right' (shapes), 'status' (/diagnostics); of the first: NEAR.
    ``profile``: of Fast DDS, on both hosts. ``parameters``: of all nodes that have them.
    """

    def __init__(self, split: str = 'taxels', *, period: float, profile: Path | None = None,
                 parameters: Mapping[str, object] | None = None):
        super().__init__()
        self.split, self.period = split, period
        self.memory: list[tuple[float, int]] = []  #: of the driver's process: when, resident [kB]
        self.waits: list[float] = []  #: when a thread of the driver was seen to wait until the link takes a packet
        self._environment = {'PYTHONPATH': str(ROOT)}
        if profile is not None:
            # With LOCALHOST rmw_fastrtps sends by another transport, whatever the profile says.
            self._environment |= {'FASTRTPS_DEFAULT_PROFILES_FILE': str(profile),
                                  'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}
        self._parameters = dict(parameters or {})
        self._stack = ExitStack()

    def __enter__(self) -> 'LinkWorld':
        try:
            self._start()
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *problem: object) -> None:
        self._stack.close()

    def _start(self) -> None:
        stack, is_on_both = self._stack, SPLITS[self.split]
        self.link = stack.enter_context(LossyHosts())
        self._folder = Path(stack.enter_context(TemporaryDirectory()))
        self._port = str(self._folder / 'skin')
        self.skin = SkinProcess(self._port, {})
        stack.callback(self.skin.end)
        near, far = self.link.both
        self.consume(near, {NEAR[pad]: f'{pad}/taxels' for pad in PADS})
        self.consumer = self.consume(far, {'grasp': 'grasp', **{pad: f'{pad}/shape' for pad in PADS},
                                           'status': '/diagnostics'},
                                     best_effort=bool(self._parameters.get('best_effort')))
        of_bus = ['--interface', 'slcan', '--channel', self._port, '--node-id', ','.join(map(str, NODE_IDS)),
                  '--layout', LAYOUT]
        if is_on_both:
            self.thinking = self._bringup(far, ['--side', 'perception'])
            of_bus += ['--side', 'bus']
        self.driver = self._bringup(near, of_bus)
        for target in (self.tick, self._look):
            thread = threading.Thread(target=target, daemon=True)
            thread.start()
            stack.callback(thread.join)
        stack.callback(self._stop.set)

    def consume(self, host: Host, topics: Mapping[str, str], best_effort: bool = False) -> subprocess.Popen:
        """Start a consumer; what it prints is recorded."""
        words = [f'{name}={topic}' for name, topic in topics.items()] + ['--best-effort'] * best_effort
        consumer = self._popen(host, [str(CONSUMER), *words], stdout=subprocess.PIPE, text=True)
        threading.Thread(target=self.read, args=(consumer,), daemon=True).start()
        return consumer

    def _bringup(self, host: Host, words: list[str]) -> subprocess.Popen:
        given = {'/**': {'ros__parameters': {'sync_period': self.period, **self._parameters}}}
        file = self._folder / f'{host.address}.yaml'
        file.write_text(json.dumps(given))  # JSON is YAML
        return self._popen(host, ['-m', 'tactile_node.cli.main', 'bringup', '--pads', ','.join(PADS), *words,
                                  '--params-file', str(file)])

    def _popen(self, host: Host, words: list[str], **keywords) -> subprocess.Popen:
        process = host.popen([sys.executable, *words], self._environment, **keywords)
        self._stack.callback(process.wait)
        self._stack.callback(process.kill)
        return process

    def _look(self) -> None:
        process = Path(f'/proc/{self.driver.pid}')
        while not self._stop.wait(LOOK_PERIOD):
            resident = re.search(r'VmRSS:\s*(\d+)', (process / 'status').read_text(encoding='ascii'))
            if resident:
                self.memory.append((time.monotonic(), int(resident[1])))
            if any(SENDING in _text(task / 'wchan') for task in (process / 'task').iterdir()):
                self.waits.append(time.monotonic())

    def recovered(self, since: float, is_true: Claim) -> float:
        """Wait until a grasp comes that is fresh and true; for how long after ``since`` it took [s]."""
        def first() -> float | None:
            return next((record['time'] for record in self.of('grasp', since) if record['fresh'] and is_true(record)),
                        None)
        self.wait(first, 'a fresh and true grasp')
        return (first() or 0.0) - since

    def believed(self, claim: Claim, since: float, until: float = inf) -> float:
        """For how long a planner that follows docs/consumers.md believed ``claim``, between two times [s, monotonic].

        It estimates the age of each grasp on its arrival, and takes it for what is now until it is too old, another
        one comes, or none has come for MAX_SILENCE.
        """
        seconds, delays, ends = 0.0, DelayEstimator(), min(until, time.monotonic())
        records = [record for record in self.of('grasp', 0.0, ends) if record['age'] < NOT_KNOWN_SEC]
        for record, after in zip(records, [*(record['time'] for record in records[1:]), ends]):
            held_back, is_settled = delays.update(record['time'], record['stamp'] + record['age'])
            end = min(after, record['time'] + MAX_SILENCE, record['time'] + MAX_AGE - record['age'] - held_back)
            if is_settled and record['fresh'] and claim(record):
                seconds += max(0.0, end - max(record['time'], since))
        return seconds

    def of(self, topic: str, since: float, until: float = inf) -> list[Record]:
        """What has come on ``topic`` between two times [s, monotonic], oldest first."""
        return [record for record in list(self.records) if record['topic'] == topic and since <= record['time'] < until]

    def status(self, node: str) -> dict[str, int]:
        """What ``node`` has counted so far; it is published once a second."""
        records = (record['counts'] for record in reversed(list(self.records)) if record['topic'] == 'status')
        return next((counts[node] for counts in records if node in counts), {})

    def wait_for_status(self, node: str) -> None:
        """Until what ``node`` has counted so far is here."""
        since = time.monotonic()
        self.wait(lambda: sum(node in record['counts'] for record in self.of('status', since)) > 1, f'status of {node}')

    def growth(self, since: float) -> float:
        """How much larger the driver has become per minute since then [kB]; of the last and the first fifth."""
        times, sizes = np.array([pair for pair in list(self.memory) if pair[0] >= since]).T
        part = max(1, len(sizes) // 5)
        return float((sizes[-part:].mean() - sizes[:part].mean()) / (times[-part:].mean() - times[:part].mean()) * 60)


class Passed(NamedTuple):
    """What became of the frames that the driver published in some time; of both pads."""

    sent: int       #: taxel frames that a consumer beside the driver has received
    received: int   #: of these, as shapes by the consumer on the other host
    left_out: int   #: of these, on purpose for newer ones, as the shapes say
    missed: int     #: of these, neither: the consumer sees the gap in the sequence of the shapes
    median: float   #: from an acquisition to its shape [s]
    late: float     #: the same, 99th percentile [s]
    known: float    #: part of the time that the latest grasp was fresh
    sync_gap: float       #: the longest time between two SYNCs [s]
    published_gap: float  #: the longest time between two taxel frames of a pad beside the driver [s]
    waits: int      #: how often, of ten looks a second, the driver was waiting for the link to take a packet
    stall: float    #: the longest time for which the machine did not run this process meanwhile [s]

    @property
    def unnoticed(self) -> int:
        """Frames that neither came nor are seen to be missing."""
        return self.sent - self.received - self.left_out - self.missed


def passed(world: LinkWorld, since: float, until: float) -> Passed:
    """Of the frames acquired between two times [s, monotonic]; what has come until now."""
    offset = time.time() - time.monotonic()
    counts = np.zeros(4, dtype=int)
    delays: list[float] = []
    syncs, published = [0.0], [0.0]
    for pad in PADS:
        near = [record for record in world.of(NEAR[pad], since) if since <= record['stamp'] - offset < until]
        shapes = {record['sequence']: record for record in world.of(pad, 0.0)}
        counts += _fates({record['sequence'] for record in near}, shapes)
        delays += [shapes[record['sequence']]['latency'] for record in near if record['sequence'] in shapes]
        syncs += np.diff([record['stamp'] for record in near]).tolist()
        published += np.diff([record['time'] for record in near]).tolist()
    grasps = world.of('grasp', since, until)
    ends = [record['time'] for record in grasps[1:]] + [until]
    known = sum(end - record['time'] for record, end in zip(grasps, ends) if record['fresh'])
    median, late = np.percentile(delays, (50, 99)).tolist() if delays else (nan, nan)
    stalls = [length for begin, length in list(world.stalls) if since <= begin < until]
    waits = sum(since <= at < until for at in list(world.waits))
    return Passed(*counts.tolist(), median, late, known / (until - since), max(syncs), max(published), waits,
                  max(stalls, default=0.0))


def _text(file: Path) -> str:
    """Of a file of /proc; empty where its thread has ended."""
    try:
        return file.read_text(encoding='ascii')
    except OSError:
        return ''


def _fates(sent: set[int], shapes: Mapping[int, Record]) -> tuple[int, int, int, int]:
    """Sequence numbers: how many were sent, received, left out, missed between others."""
    left_out = {before for number, shape in shapes.items() for before in range(number - shape['left_out'], number)}
    lost = sent - shapes.keys()
    missed = {number for number in lost - left_out if shapes and min(shapes) < number < max(shapes)}
    return len(sent), len(sent & shapes.keys()), len(lost & left_out), len(missed)
