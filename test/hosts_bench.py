"""A gripper's processing chain on two hosts: skin and driver run on the first host, the planner on the second.

The bench starts the nodes with `tactile bringup`, as a user does. The claims, records and allowed times are defined in
misled_bench.py. All processes use the steady clock of this machine.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Any

from misled_bench import (
    PERIOD,
    TIMEOUT,
    FalseClaim,
    Finding,
    Popen,
    Record,
    SkinProcess,
    World,
    current,
    empty,
)
from misled_skin import LAYOUT, NODE_IDS, PADS
from two_hosts import Host, Hosts

DRIVER = 'skin_driver'
TOPICS = ('grasp=grasp', 'left=left/shape', 'right=right/shape', 'health=/diagnostics', 'status=skin_driver/status')
SIDES = {'bus': 'bus', 'thinking': 'perception'}  #: maps each host to its side of `tactile bringup`
DISCOVERY_PORT = 11811  # default port of Fast DDS's discovery server
SENDING = 'sock_alloc_send'  # kernel function in which a thread waits for free space in a socket


NODES = {'/skin_driver', *(f'/{pad}/{role}' for pad in PADS for role in ('processor', 'classifier')), '/grasp'}
CLIENT = Path(__file__).with_name('hosts_client.py')


def missing(shapes: list[Record]) -> int:
    """Return the number of frames lost between ``shapes``, not counting frames that a stage left out on purpose."""
    return sum(max(0, after['sequence'] - before['sequence'] - 1 - after['left_out'])
               for before, after in zip(shapes, shapes[1:]))


def withdrawn(period: float) -> float:
    """Return the time within which `fresh` is withdrawn, for this time between two frames [s]."""
    return max(0.1, 3 * period)


def held(record: Record) -> bool:
    """Return True if the record states that an object is currently held."""
    return current(record) and record['contact'] in ('ONE_SIDED', 'TWO_SIDED')


def _text(file: Path) -> str:
    """Return the text of a file in /proc, or '' if the thread that it describes has ended."""
    try:
        return file.read_text(encoding='ascii')
    except OSError:
        return ''


class HostsWorld(World):
    """A gripper that holds an object.

    The gripper's nodes run on both ``hosts``, and the consumer runs on the second host.

    Parameters
    ----------
    hosts
        The two hosts.
    held
        Attributes of the held object that differ from their defaults.
    topics
        Topics to which the consumer subscribes.
    here
        Topics to which another consumer on the first host subscribes. The other consumer adds its records to
        `here_records`.
    period
        Time between two frames [s].
    discovery_server
        True if a discovery server on the first host replaces the list of peer addresses.
    environment
        Additional environment variables for all processes.
    given
        ROS parameters for all nodes.
    """

    has_sides = True  #: False if all nodes run on the first host

    def __init__(self, hosts: Hosts, held: dict[str, Any] | None = None, *,
                 topics: tuple[str, ...] = TOPICS, here: tuple[str, ...] = (), period: float = PERIOD,
                 discovery_server: bool = False, environment: dict[str, str] | None = None,
                 given: tuple[str, ...] = ()):
        super().__init__(held, topics=topics, period=period)
        self.hosts, self._here = hosts, here
        self._environment = {'ROS_DOMAIN_ID': str(1 + os.getpid() % 100), 'PYTHONUNBUFFERED': '1',
                             **(environment or {})}
        self._has_server, self._given = discovery_server, given
        if discovery_server:
            self._environment |= {'ROS_DISCOVERY_SERVER': f'{hosts.first.address}:{DISCOVERY_PORT}',
                                  'ROS_STATIC_PEERS': ''}
        self.here_records: list[Record] = []
        self.bringups: dict[str, subprocess.Popen] = {}  #: maps the host, 'bus' or 'thinking', to its process

    def _start(self, stack: ExitStack) -> None:
        first, second = self.hosts.both
        folder = Path(stack.enter_context(TemporaryDirectory()))
        self._port = str(folder / 'skin')
        self._log = stack.enter_context(open(folder / 'log', 'w', encoding='utf-8'))
        if self._has_server:
            self._serve(stack, first)
        self._consume(stack, self._topics, self.records, self._on(second))
        if self._here:
            self._consume(stack, self._here, self.here_records, self._on(first))
        self.skin = SkinProcess(self._port, self._held, self._on(first))
        stack.callback(self.skin.end)
        stack.callback(self._end_all)
        self.start('thinking')
        self.start('bus')
        ticker = Thread(target=self.tick, daemon=True)
        ticker.start()
        stack.callback(ticker.join)
        stack.callback(self._stop.set)

    def start(self, side: str) -> None:
        """Run `tactile bringup` with the nodes of one side."""
        host = self.hosts.first if side == 'bus' else self.hosts.second
        words = ['--interface', 'slcan', '--channel', self._port, '--node-id', ','.join(map(str, NODE_IDS)),
                 '--layout', LAYOUT] if side == 'bus' else []
        given = [*self._given, *([f'{DRIVER}:sync_period:={self.period}'] if side == 'bus' else [])]
        self.bringups[side] = self._on(host)(
            [sys.executable, '-m', 'tactile_node.cli.main', 'bringup', '--pads', ','.join(PADS),
             *(['--side', SIDES[side]] if self.has_sides else []), *words, '--ros-args',
             *(word for one in given for word in ('-p', one))], stdout=self._log, stderr=self._log)

    def end(self, side: str, is_killed: bool = False) -> None:
        process = self.bringups.pop(side)
        process.kill() if is_killed else process.terminate()
        process.wait(TIMEOUT)

    def on_second(self, command: list[str], **keywords: Any) -> subprocess.Popen:
        """Start another process on the second host."""
        return self._on(self.hosts.second)(command, **keywords)

    def driver_waits(self, seconds: float) -> int:
        """Check every 0.1 s if a thread on the bus host is waiting for the link, and return how often one was."""
        ends, found = time.monotonic() + seconds, 0
        while time.monotonic() < ends:
            time.sleep(0.1)
            tasks = Path(f'/proc/{self.bringups["bus"].pid}/task').glob('*/wchan')
            found += any(SENDING in _text(task) for task in tasks)
        return found

    def skipped(self, node: str) -> int:
        """Return the number of messages that ``node`` has reported as skipped or dropped."""
        return sum(int(value) for key, value in self.values.get(node, {}).items()
                   if key == 'skipped' or key.startswith('dropped_'))

    @property
    def values(self) -> dict[str, dict[str, str]]:
        """The latest values of each node on /diagnostics."""
        return {node: values for record in self.received('health', 0.0) for node, values in record['nodes'].items()}

    def received(self, topic: str, since: float) -> list[Record]:
        return [record for record in list(self.records) if record['topic'] == topic and record['time'] > since]

    def wait_for_no_contact(self) -> None:
        self.wait(lambda: self.latest('grasp')['contact'] == 'NO_CONTACT' and current(self.latest('grasp')),
                  'an empty gripper')

    def hold_again(self, since: float) -> float:
        """Wait for a stable grasp after ``since`` [s, monotonic], and return the time until its arrival [s]."""
        stable = lambda: [record for record in self.received('grasp', since) if record['stable']]  # noqa: E731
        self.wait(stable, 'a stable grasp again')
        return float(stable()[0]['time']) - since

    def _on(self, host: Host) -> Popen:
        return lambda command, **keywords: host.popen(command, self._environment, **keywords)

    def _end_all(self) -> None:
        for process in self.bringups.values():
            process.terminate()
        for process in self.bringups.values():
            try:
                process.wait(TIMEOUT)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def _serve(self, stack: ExitStack, host: Host) -> None:
        server = Path(sys.prefix) / 'bin' / 'fast-discovery-server'
        process = self._on(host)([str(server), '-i', '0', '-l', host.address, '-p', str(DISCOVERY_PORT)],
                                 stdout=self._log, stderr=self._log)
        stack.callback(process.wait)
        stack.callback(process.kill)
        time.sleep(0.5)


def cut_and_mend(world: HostsWorld, cut: Callable[[], None], mend: Callable[[], None]) -> Finding:
    """Cut the link while the gripper holds an object, remove the object, and mend the link.

    Frames that were in transit when the link was cut must not mislead a consumer. The function returns for how long the
    consumer took the last grasp for current.
    """
    world.hold()
    cut()
    try:
        is_empty, lasting = world.watch(time.monotonic(), 1.0, FalseClaim('empty', empty), FalseClaim(
            'current', current, withdrawn(world.period) + world.period))
        world.skin.set(is_there=False)
        time.sleep(1.0)
    finally:
        back = time.monotonic()
        mend()
    assert is_empty.seconds == 0 and lasting.has_ended, (is_empty, lasting)
    try:
        world.wait_for_no_contact()
        assert world.false(FalseClaim('held', held), back).seconds == 0
        world.wait(lambda: {world.latest(side)['shape'] for side in PADS} == {'NONE'}, 'pads without a shape')
    finally:
        world.skin.set(is_there=True)
    world.hold_again(time.monotonic())
    return lasting


def use_from_other_host(world: HostsWorld) -> None:
    """Call services and actions across the link: check_grasp and wait_for_grasp, and the driver's tare."""
    world.hold(0.0)
    with world.on_second([sys.executable, str(CLIENT)], stdout=subprocess.PIPE, text=True) as client:
        answer = json.loads(client.communicate(timeout=3 * TIMEOUT)[0])
    if {answer['check'], answer['waited']} != {answer['held']}:
        raise world.failure(f'waited for the grasp to be held, got {answer}')
    assert answer['tare_refusal'] in (answer['contact'], answer['pressed'])
    assert answer['pads'] == list(PADS)
    assert answer['states'] == answer['expected_states']
    assert answer['active'] and answer['logged']
    assert answer['reported']
    world.wait(lambda: NODES <= {name.split(':')[0] for name in world.values}, 'the diagnostics of each node')
    world.hold_again(time.monotonic())
