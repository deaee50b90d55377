"""Two hosts on one machine: network namespaces that are joined by a veth pair, or by a link that a test makes bad.

Each host has a separate network, /dev/shm and System V IPC, so that nothing but the link joins them: Fast DDS would
otherwise pass data through shared memory, and a cut would cut nothing. Neither root nor netem is needed, but a kernel
that allows user namespaces, and /dev/net/tun for the link that loses packets.
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

ADDRESSES = '10.99.0.1', '10.99.0.2'
RELAY = Path(__file__).with_name('lossy_link.py')
SETUP = 'mount -t tmpfs tmpfs /dev/shm && ip link set lo up && echo ready && exec sleep infinity'
ENTER = 'nsenter', '--preserve-credentials', '--user', '--net', '--ipc', '--mount'


class NoHostsError(RuntimeError):
    """This machine makes no network namespaces, or no such link between them."""


class Host:
    """A network namespace, held by a process that sleeps."""

    def __init__(self, address: str, peer: str, inside: 'Host | None' = None):
        self.address, self._peer = address, peer
        if inside is None:
            command = ['unshare', '--user', '--map-root-user', '--net', '--mount', '--ipc', 'sh', '-c', SETUP]
        else:  # in the same user namespace: only then may an interface be moved from one to the other
            command = [*inside.enter(), 'unshare', '--net', '--mount', '--ipc', 'sh', '-c', SETUP]
        try:
            self._process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                             stderr=subprocess.PIPE, text=True)
        except OSError as error:
            raise NoHostsError(f'no network namespace: {error}') from error
        assert self._process.stdout
        if self._process.stdout.readline() != 'ready\n':
            self.end()
            assert self._process.stderr
            raise NoHostsError(f'no network namespace: {self._process.stderr.read().strip()}')

    @property
    def pid(self) -> int:
        return self._process.pid

    def enter(self) -> list[str]:
        """The words to put before a command that is to run on this host."""
        return [*ENTER, '--target', str(self.pid)]

    def environment(self, **more: str) -> dict[str, str]:
        """As on a real host: discovery goes to the other host by its address, without multicast."""
        return {**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', 'ROS_STATIC_PEERS': self._peer, **more}

    def popen(self, command: Sequence[str], environment: Mapping[str, str] | None = None,
              **keywords) -> subprocess.Popen:
        """Start ``command`` on this host, in the folder /; ``environment`` adds to that of the host.

        The process is the command's: nsenter replaces itself by it.
        """
        return subprocess.Popen([*self.enter(), '--', *command], env=self.environment(**(environment or {})),
                                **keywords)

    def run(self, *command: str) -> str:
        """Run to the end; return what it printed. Raises NoHostsError when it fails."""
        done = subprocess.run([*self.enter(), '--', *command], capture_output=True, text=True, check=False)
        if done.returncode:
            raise NoHostsError(f'{" ".join(command)}: {done.stderr.strip()}')
        return done.stdout

    def end(self) -> None:
        self._process.kill()
        self._process.wait()


class Hosts:
    """Two hosts joined by a veth pair: ``first`` and ``second``. A context; raises NoHostsError."""

    def __init__(self):
        self._stack = ExitStack()

    def __enter__(self):
        with ExitStack() as stack:
            self.first = Host(*ADDRESSES)
            stack.callback(self.first.end)
            self.second = Host(*ADDRESSES[::-1], inside=self.first)
            stack.callback(self.second.end)
            self._join(stack)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *problem: object) -> None:
        self._stack.close()

    @property
    def both(self) -> tuple[Host, Host]:
        return self.first, self.second

    def _join(self, stack: ExitStack) -> None:
        first, second = self.both
        first.run('ip', 'link', 'add', 'veth0', 'type', 'veth', 'peer', 'name', 'veth1')
        first.run('ip', 'link', 'set', 'veth1', 'netns', str(second.pid))
        for host, name in zip(self.both, ('veth0', 'veth1'), strict=True):
            host.run('ip', 'address', 'add', f'{host.address}/24', 'dev', name)
            host.run('ip', 'link', 'set', name, 'up')

    def plug(self, is_in: bool) -> None:
        """Plug the cable in at the first host, or pull it."""
        self.first.run('ip', 'link', 'set', 'veth0', 'up' if is_in else 'down')

    def octets(self) -> int:
        """What the first host has received from the link and sent over it."""
        found = json.loads(self.first.run('ip', '-json', '-statistics', 'link', 'show', 'veth0'))
        return sum(found[0]['stats64'][direction]['bytes'] for direction in ('rx', 'tx'))


class LossyHosts(Hosts):
    """Two hosts joined by a relay between two tun interfaces: ``set`` makes the link bad."""

    def _join(self, stack: ExitStack) -> None:
        words = [sys.executable, str(RELAY), str(self.second.pid)]
        for host in self.both:
            words += [host.address]
        self._relay = self.first.popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        stack.callback(self._end_relay)
        if not self._answer().get('ready'):
            raise NoHostsError('no tun interface: is /dev/net/tun there?')

    def _end_relay(self) -> None:
        self._relay.kill()
        self._relay.wait()

    def set(self, *, loss: float = 0.0, delay: float = 0.0, jitter: float = 0.0) -> None:
        """Change the link, both directions alike.

        ``loss``: part of the packets, 0 to 1. ``delay`` [s] for each packet, and up to ``jitter`` [s] more or less,
        evenly spread: packets overtake.
        """
        assert self._relay.stdin
        self._relay.stdin.write(json.dumps({'loss': loss, 'delay': delay, 'jitter': jitter}) + '\n')
        self._relay.stdin.flush()
        assert self._answer()

    def _answer(self) -> dict:
        assert self._relay.stdout
        line = self._relay.stdout.readline()
        return json.loads(line) if line else {}
