"""A link between two network namespaces that loses, delays and cuts: relays IP packets between two tun interfaces.

    python lossy_link.py PID_OF_THE_OTHER_NAMESPACE ADDRESS_HERE ADDRESS_THERE

Started in the first namespace by two_hosts.py. Each line on standard input is a command, answered by a line. What a
link of Ethernet has and this has not: ARP, multicast, a rate. A packet that waits for its delay is not counted as lost.
"""

import ctypes
import fcntl
import heapq
import itertools
import json
import os
import random
import select
import struct
import subprocess
import sys
import time
from typing import NamedTuple

TUNSETIFF = 0x400454ca  # linux/if_tun.h
IFF_TUN, IFF_NO_PI = 0x0001, 0x1000
CLONE_NEWNET = 0x40000000  # linux/sched.h
MTU = 1500
MOST_WAITING = 20_000  # packets, as a router's queue: more are lost
SEED = 16


class Link(NamedTuple):
    """As two_hosts.LossyHosts.set documents it."""

    loss: float = 0.0
    burst: float = 1.0
    delay: float = 0.0
    jitter: float = 0.0
    is_cut: bool = False


class Losses:
    """Which packets are lost: Gilbert's two states, of which the bad one loses every packet."""

    def __init__(self) -> None:
        self._random = random.Random(SEED)
        self._is_bad = False

    def loses(self, link: Link) -> bool:
        if not link.loss:
            return False
        leave = 1 / link.burst
        enter = link.loss * leave / (1 - link.loss)
        self._is_bad = self._random.random() < (1 - leave if self._is_bad else enter)
        return self._is_bad

    def wait(self, link: Link) -> float:
        return max(0.0, link.delay + self._random.uniform(-link.jitter, link.jitter))


class Relay:
    """Between the two tun devices ``ends``."""

    def __init__(self, ends: tuple[int, int]):
        self._other = {ends[0]: ends[1], ends[1]: ends[0]}
        self._losses = {end: Losses() for end in ends}
        self._link = Link()
        self._waiting: list[tuple[float, int, int, bytes]] = []  # when it goes out, order, where, what
        self._order = itertools.count()
        self._counts = {'carried': 0, 'lost': 0, 'cut': 0, 'octets': 0}

    def run(self) -> None:
        """Until standard input ends."""
        while True:
            readable, _, _ = select.select([sys.stdin, *self._other], [], [], self._next_wait())
            if sys.stdin in readable and not self._obey(sys.stdin.readline()):
                return
            for end in self._other:
                if end in readable:
                    self._take(end)
            self._send_due()

    def _next_wait(self) -> float | None:
        return max(0.0, self._waiting[0][0] - time.monotonic()) if self._waiting else None

    def _obey(self, line: str) -> bool:
        if not line:
            return False
        command = json.loads(line)
        if 'counts' in command:
            answer(self._counts)
            return True
        self._link = Link(**command)
        if self._link.is_cut:  # what is on its way is lost, too
            self._counts['cut'] += len(self._waiting)
            self._waiting.clear()
        answer({'done': True})
        return True

    def _take(self, end: int) -> None:
        packet = os.read(end, MTU + 100)
        if self._link.is_cut:
            self._counts['cut'] += 1
        elif self._losses[end].loses(self._link) or len(self._waiting) >= MOST_WAITING:
            self._counts['lost'] += 1
        else:
            due = time.monotonic() + self._losses[end].wait(self._link)
            heapq.heappush(self._waiting, (due, next(self._order), self._other[end], packet))

    def _send_due(self) -> None:
        now = time.monotonic()
        while self._waiting and self._waiting[0][0] <= now:
            _, _, end, packet = heapq.heappop(self._waiting)
            os.write(end, packet)
            self._counts['carried'] += 1
            self._counts['octets'] += len(packet)


def tun(here: str, there: str) -> int:
    """Make a tun interface in the present namespace, up, and return its file descriptor."""
    end = os.open('/dev/net/tun', os.O_RDWR)
    fcntl.ioctl(end, TUNSETIFF, struct.pack('16sH22x', b'tun0', IFF_TUN | IFF_NO_PI))
    for words in (f'address add {here} peer {there} dev tun0', f'link set tun0 mtu {MTU} txqueuelen 5000 up'):
        subprocess.run(['ip', *words.split()], check=True)
    return end


def answer(fields: dict) -> None:
    print(json.dumps(fields), flush=True)


def main() -> None:
    process, here, there = sys.argv[1:]
    first = tun(here, there)
    with open(f'/proc/{process}/ns/net', encoding='utf-8') as namespace:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.setns(namespace.fileno(), CLONE_NEWNET):
            raise OSError(ctypes.get_errno(), 'setns')
    second = tun(there, here)
    answer({'ready': True})
    Relay((first, second)).run()


if __name__ == '__main__':
    main()
