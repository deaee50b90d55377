"""Two hosts on one machine: network namespaces that are joined by a veth pair, or by a link that a test can disturb.

Each host has its own network, /dev/shm and System V IPC, so that the link is the only connection between the hosts.
With a common /dev/shm, Fast DDS would pass data through shared memory, and cutting the link would have no effect. The
module needs a kernel that allows user namespaces, and /dev/net/tun for the link that loses packets. The module needs
neither root nor netem.
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
    """Raised if this machine cannot create network namespaces, or the link between them."""


class Host:
    """A network namespace, kept alive by a sleeping process."""

    def __init__(self, address: str, peer: str, inside: 'Host | None' = None):
        self.address, self._peer = address, peer
        if inside is None:
            command = ['unshare', '--user', '--map-root-user', '--net', '--mount', '--ipc', 'sh', '-c', SETUP]
        else:  # an interface can move between network namespaces only within one user namespace
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
        """Return the words to put before a command so that it runs on this host."""
        return [*ENTER, '--target', str(self.pid)]

    def environment(self, **more: str) -> dict[str, str]:
        """Return the environment of a real host: discovery uses the address of the other host, without multicast."""
        return {**os.environ, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', 'ROS_STATIC_PEERS': self._peer, **more}

    def popen(self, command: Sequence[str], environment: Mapping[str, str] | None = None,
              **keywords) -> subprocess.Popen:
        """Start ``command`` on this host, in the folder /.

        The variables in ``environment`` are added to the environment of the host.

        The returned process is that of the command, because nsenter replaces itself with the command.
        """
        return subprocess.Popen([*self.enter(), '--', *command], env=self.environment(**(environment or {})),
                                **keywords)

    def run(self, *command: str) -> str:
        """Run ``command`` to its end and return its output. Raises NoHostsError if the command fails."""
        done = subprocess.run([*self.enter(), '--', *command], capture_output=True, text=True, check=False)
        if done.returncode:
            raise NoHostsError(f'{" ".join(command)}: {done.stderr.strip()}')
        return done.stdout

    def end(self) -> None:
        self._process.kill()
        self._process.wait()


class Hosts:
    """Context manager for two hosts, ``first`` and ``second``, joined by a veth pair. Raises NoHostsError."""

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
        """Plug in the cable at the first host, or pull it out."""
        self.first.run('ip', 'link', 'set', 'veth0', 'up' if is_in else 'down')

    def octets(self) -> int:
        """Return the number of bytes that the first host has received and sent over the link."""
        found = json.loads(self.first.run('ip', '-json', '-statistics', 'link', 'show', 'veth0'))
        return sum(found[0]['stats64'][direction]['bytes'] for direction in ('rx', 'tx'))


class LossyHosts(Hosts):
    """Two hosts joined by a relay between two tun interfaces. The method ``set`` disturbs the link."""

    def _join(self, stack: ExitStack) -> None:
        words = [sys.executable, str(RELAY), str(self.second.pid)]
        for host in self.both:
            words += [host.address]
        self._relay = self.first.popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        stack.callback(self._end_relay)
        if not self._answer().get('ready'):
            raise NoHostsError('the tun interface could not be created; check that /dev/net/tun exists')

    def _end_relay(self) -> None:
        self._relay.kill()
        self._relay.wait()

    def set(self, *, loss: float = 0.0, delay: float = 0.0, jitter: float = 0.0) -> None:
        """Change the properties of the link in both directions.

        ``loss`` is the fraction of lost packets, from 0 to 1. ``delay`` is the delay of each packet [s]. ``jitter`` is
        the largest change of a packet's delay, uniformly distributed [s], so that packets overtake each other.
        """
        assert self._relay.stdin
        self._relay.stdin.write(json.dumps({'loss': loss, 'delay': delay, 'jitter': jitter}) + '\n')
        self._relay.stdin.flush()
        assert self._answer()

    def _answer(self) -> dict:
        assert self._relay.stdout
        line = self._relay.stdout.readline()
        return json.loads(line) if line else {}
