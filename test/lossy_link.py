"""A link between two network namespaces that loses and delays packets.

The script relays IP packets between two tun devices.

    python lossy_link.py PID_OF_THE_OTHER_NAMESPACE ADDRESS_HERE ADDRESS_THERE

two_hosts.py starts this script in the first namespace. Each line on standard input is a command, to which the script
responds with one line. Unlike an Ethernet link, this link has no ARP, no multicast and no rate limit.
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
MOST_WAITING = 20_000  #: Length of the packet queue. If the queue is full, the link drops packets like a router.
SEED = 16


class Link(NamedTuple):
    """State of the link. LossyHosts.set in two_hosts.py describes the fields."""

    loss: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0


class Relay:
    """Relays packets between the two tun devices in ``ends``."""

    def __init__(self, ends: tuple[int, int]):
        self._other = {ends[0]: ends[1], ends[1]: ends[0]}
        self._random = random.Random(SEED)
        self._link = Link()
        # Tuples of send time, sequence number, target device and packet.
        self._waiting: list[tuple[float, int, int, bytes]] = []
        self._order = itertools.count()

    def run(self) -> None:
        """Relay packets until standard input is closed."""
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
        if line:
            self._link = Link(**json.loads(line))
            answer({'done': True})
        return bool(line)

    def _take(self, end: int) -> None:
        packet, link = os.read(end, MTU + 100), self._link
        if self._random.random() < link.loss or len(self._waiting) >= MOST_WAITING:
            return
        wait = max(0.0, link.delay + self._random.uniform(-link.jitter, link.jitter))
        heapq.heappush(self._waiting, (time.monotonic() + wait, next(self._order), self._other[end], packet))

    def _send_due(self) -> None:
        while self._waiting and self._waiting[0][0] <= time.monotonic():
            _, _, end, packet = heapq.heappop(self._waiting)
            os.write(end, packet)


def tun(here: str, there: str) -> int:
    """Create a tun interface in the current namespace, bring it up, and return its file descriptor."""
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
