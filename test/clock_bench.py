"""The chain on two hosts whose wall clocks are apart: driver and thinking nodes in a process each, both on libfaketime.

The skin, the way between the hosts and the consumer are outside of both. The truth is the steady clock, which all
processes of this machine share: when the skin was scanned, and what the wall clock of each host shows.
"""

import json
import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from misled_bench import QOS, Record, Relay, SkinProcess, TooSlowError, is_overloaded
from misled_skin import LAYOUT, NODE_IDS, PADS
from rclpy.executors import SingleThreadedExecutor

from tactile_node.ros.message_age import age_seconds
from tactile_node.ros.time_messages import seconds
from tactile_skin.msg import TaxelArray

HERE = Path(__file__).parent
LIBRARIES = tuple(Path('/usr/lib').glob('*/faketime/libfaketimeMT.so.1'))  #: Debian and Ubuntu: apt install faketime
PERIOD = 0.1  # s between two frames: a busy machine keeps up
HOSTS = ('bus', 'thinking')
BEFORE, AFTER = 3.0, 0.5  # s around a report in which a jump spoils it: ages settle, a new clock is printed late
STEADY = 0.008  # s: more is no drift
TIMEOUT = 120.0 if 'TACTILE_LONG' in os.environ else 60.0  # s, for a busy machine


class Report(NamedTuple):
    """What a node reports of the stamps that it receives."""

    at: float      #: [s, steady]
    node: str
    offset: float  #: by which stamps are ahead of the clock of its host [s]
    faults: str
    lead: float    #: of the newest stamp + age on the way between the hosts, against the steady clock [s]


class Aged(NamedTuple):
    """A grasp as the consumer had it."""

    at: float     #: when it arrived [s, steady]
    age: float    #: on arrival, as the consumer has it [s]
    true: float   #: since the skin was scanned, of the older side [s]
    way: float    #: of that, held back on the way to the consumer [s]
    fresh: bool   #: when it was sent


class Host:
    """A process with another wall clock."""

    def __init__(self, folder: Path, name: str, setting: str, words: list[str], *, at_once: bool):
        self._setting = folder / f'{name}.time'
        self.set(setting)
        self.leads: list[tuple[float, float]] = []  #: when [s, steady], wall clock - steady clock [s]
        environment = os.environ | {
            'LD_PRELOAD': str(LIBRARIES[0]), 'FAKETIME_DONT_FAKE_MONOTONIC': '1',
            'FAKETIME_TIMESTAMP_FILE': str(self._setting),
            **({'FAKETIME_NO_CACHE': '1'} if at_once else {'FAKETIME_CACHE_DURATION': '1'})}
        self._process = subprocess.Popen([sys.executable, str(HERE / 'other_clock.py'), *words], text=True,
                                         env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def set(self, setting: str) -> None:
        """Set its clock: "+0.2", or with a rate "+0 x1.0005" (faketime(1)); it is read within a second."""
        new = self._setting.with_suffix('.new')
        new.write_text(setting)
        new.replace(self._setting)

    def slew(self, begin: float, end: float, rate: float) -> None:
        """Lead it from the offset ``begin`` to ``end`` [s] at the relative ``rate``, as a daemon does; returns then."""
        began, length = time.monotonic(), abs(end - begin) / rate
        while (passed := time.monotonic() - began) < length:
            self.set(f'{begin + (end - begin) * passed / length:+.6f}')
            time.sleep(0.01)
        self.set(f'{end:+.6f}')

    def lead(self, at: float) -> float:
        """Return wall clock - steady clock at ``at`` [s, steady]."""
        return min(list(self.leads), key=lambda each: abs(each[0] - at))[1]

    def change(self, begin: float, end: float) -> float:
        """Return how far its clock was set between two times [s, steady]."""
        leads = [lead for at, lead in list(self.leads) if begin <= at <= end]
        return max(leads) - min(leads) if leads else 0.0

    def end(self) -> None:
        self._process.kill()
        self._process.wait()
        self._reader.join()

    def _read(self) -> None:
        for line in self._process.stdout:
            if line.startswith('{"at"'):
                found = json.loads(line)
                self.leads.append((found['at'], found['lead']))


class ClockWorld:
    """A gripper that holds an object; ``bus``, ``thinking``: settings of the two hosts' clocks.

    ``at_once``: a setting is read at each look at the clock, which costs processor time; else once a second.
    """

    def __init__(self, bus: str = '+0', thinking: str = '+0', *, at_once: bool = False):
        self._at_once = at_once
        self._settings = dict(zip(HOSTS, (bus, thinking)))
        self.hosts: dict[str, Host] = {}
        self.records: list[Record] = []  #: of the consumer
        self.reports: list[Report] = []
        self._lead = math.nan  # as in a Report
        self._arrivals: dict[int, float] = {}  # of the left pad's taxels on the way between the hosts, by sequence
        self._stack = ExitStack()
        self._stop = threading.Event()

    def __enter__(self) -> 'ClockWorld':
        try:
            self._start()
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *problem: object) -> None:
        self._stack.close()

    def _start(self) -> None:
        stack = self._stack
        context = rclpy.context.Context()
        rclpy.init(context=context)
        stack.callback(context.try_shutdown)
        folder = Path(stack.enter_context(TemporaryDirectory()))
        self.skin = SkinProcess(str(folder / 'skin'), {})
        stack.callback(self.skin.end)
        node = rclpy.create_node('way', context=context)
        node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, QOS)
        node.create_subscription(TaxelArray, 'left/taxels', self._on_taxels, QOS)
        self.relays = [Relay(node, TaxelArray, f'{pad}/taxels', f'{pad}/relayed') for pad in PADS]
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        spinner = threading.Thread(target=lambda: self._spin(executor), daemon=True)
        stack.callback(node.destroy_node)
        spinner.start()
        stack.callback(spinner.join)
        stack.callback(self._stop.set)
        self._consume(stack)
        parameters = {'interface': 'slcan', 'channel': folder / 'skin', 'pads': list(PADS), 'layouts': [LAYOUT],
                      'node_ids': list(NODE_IDS), 'sync_period': PERIOD}
        words = {'bus': ['tactile_node.nodes.driver_node', '--ros-args',
                         *(word for name, value in parameters.items() for word in ('-p', f'{name}:={value}'))],
                 'thinking': ['tactile_node.cli.main', 'bringup', '--pads', ','.join(PADS), '--side', 'perception',
                              '--ros-args', '-r', 'processor:taxels:=relayed']}
        for name in reversed(HOSTS):
            self.hosts[name] = host = Host(folder, name, self._settings[name], words[name], at_once=self._at_once)
            stack.callback(host.end)

    def _spin(self, executor: SingleThreadedExecutor) -> None:
        while not self._stop.is_set():
            executor.spin_once(timeout_sec=0.1)
        executor.shutdown()

    def _consume(self, stack: ExitStack) -> None:
        consumer = subprocess.Popen([sys.executable, str(HERE / 'misled_consumer.py'), 'grasp=grasp'], text=True,
                                    stdout=subprocess.PIPE)
        reader = threading.Thread(target=self._read, args=(consumer,), daemon=True)
        reader.start()
        stack.callback(reader.join)
        stack.callback(consumer.wait)
        stack.callback(consumer.kill)

    def _read(self, consumer: subprocess.Popen) -> None:
        for line in consumer.stdout:
            self.records.append(json.loads(line))

    def _on_taxels(self, message: TaxelArray) -> None:
        if (age := age_seconds(message.age)) < 1:
            self._arrivals[message.sequence] = now = time.monotonic()
            self._lead = seconds(message.header.stamp) + age - now

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        now = time.monotonic()
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            if values.get('stamps_offset_s', 'not known') != 'not known':
                self.reports.append(Report(now, status.name, float(values['stamps_offset_s']), values['faults'],
                                           self._lead))

    def compared(self, since: float = 0.0) -> list[tuple[Report, float]]:
        """Return the reports after ``since`` [s, steady] in whose time no clock was set, with their errors [s]."""
        return [(report, report.offset - report.lead + self.hosts['thinking'].lead(report.at))
                for report in list(self.reports)
                if since < report.at < time.monotonic() - AFTER and all(
                    host.change(report.at - BEFORE, report.at + AFTER) < STEADY for host in self.hosts.values())]

    def wait(self, condition: Callable[[], Any], what: str, timeout: float = TIMEOUT) -> None:
        end = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > end:
                error = TooSlowError if is_overloaded() else AssertionError
                raise error(f'waited {timeout:.0f} s for {what}; last: {self.records[-2:]}')
            time.sleep(0.01)

    def grasps(self, since: float = 0.0) -> list[Record]:
        return [record for record in list(self.records) if record['topic'] == 'grasp' and record['time'] > since]

    def hold(self, since: float = 0.0) -> float:
        """Wait for a grasp that is stable and came after ``since`` [s, steady]; when it came."""
        self.wait(lambda: any(record['stable'] for record in self.grasps(since)), 'a stable grasp')
        return next(record['time'] for record in self.grasps(since) if record['stable'])

    def ages(self, since: float = 0.0) -> list[Aged]:
        """Return the grasps after ``since`` [s, steady] whose age is known, and how old they were in truth."""
        arrivals = dict(self._arrivals)
        scans = [self.skin.scans(pad) for pad in PADS]  # the driver numbers by SYNC, as they are
        early = {number: at for number, at in arrivals.items()
                 if not (number < len(scans[0]) and at > scans[0][number])}
        if early:
            error = TooSlowError if is_overloaded() else AssertionError  # numbers that an outage has left out
            raise error(f'{len(early)} of {len(arrivals)} messages came before their scan, the first {min(early)}; '
                        f'{len(scans[0])} scans')
        found = []
        for record in self.grasps(since):
            if record['age_here'] is not None and all(record['sequences']):
                scanned = min(of_pad[number] for number, of_pad in zip(record['sequences'], scans))
                age = record['age_here']
                found.append(Aged(record['time'], age, record['time'] - scanned, age - record['age'], record['fresh']))
        return found


def recovery(world: ClockWorld, since: float) -> float:
    """For how long after ``since`` [s, steady] the consumer's latest grasp was not stable, in total [s]."""
    grasps = world.grasps(since - 1.0)
    ends = [record['time'] for record in grasps[1:]] + [time.monotonic()]
    return sum(end - max(since, record['time']) for record, end in zip(grasps, ends)
               if end > since and not record['stable'])
