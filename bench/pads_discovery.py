"""What discovery costs: bytes on a separate network while 2, 4 and 8 grippers join one DDS domain.

    python bench/pads_discovery.py [--most 8] [--settle 12]

A gripper is `tactile bringup` with two pads, in one process and so one DDS participant; its driver is not started, so
that there is no traffic but discovery. All are in one network namespace (unshare -rn, no root needed), over UDP alone,
as between hosts. Every byte that the loopback device carries is counted, headers of UDP and IP included.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
COUNTERS = Path('/proc/net/dev')  #: of the namespace of this process, as /sys/class/net is not
SIZES = 1, 2, 4, 8, 16
START_TIMEOUT = 120.0  #: s


class Joined(NamedTuple):
    """After so many participants have joined, those before included."""

    participants: int
    joining: int   #: bytes since the step before, until all have been found
    steady: float  #: bytes a second after that


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--most', type=int, default=8, help='participants, default %(default)s')
    parser.add_argument('--settle', type=float, default=15.0, help='s after the last has started, default %(default)s')
    parser.add_argument('--inside', action='store_true', help='already in its network namespace')
    args = parser.parse_args()
    if not args.inside:
        return subprocess.run(['unshare', '-rn', sys.executable, __file__, *sys.argv[1:], '--inside']).returncode
    subprocess.run(['ip', 'link', 'set', 'lo', 'up', 'multicast', 'on'], check=True)
    subprocess.run(['ip', 'route', 'add', '224.0.0.0/4', 'dev', 'lo'], check=True)
    for joined in measured([size for size in SIZES if size <= args.most], args.settle):
        print(json.dumps(joined), flush=True)
    return 0


def measured(sizes: list[int], settle: float) -> list[Joined]:
    """Start grippers until there are so many, and measure at each size."""
    processes: list[subprocess.Popen] = []
    found: list[Joined] = []
    try:
        for size in sizes:
            before = carried()
            while len(processes) < size:
                processes.append(gripper(len(processes)))
            wait_until_ready(processes)
            time.sleep(settle)
            joining, begun = carried(), time.monotonic()
            time.sleep(settle)
            found.append(Joined(size, joining - before, (carried() - joining) / (time.monotonic() - begun)))
    finally:
        for process in processes:
            process.send_signal(signal.SIGINT)
        for process in processes:
            process.wait(60)
    return found


def gripper(number: int) -> subprocess.Popen:
    words = [sys.executable, '-m', 'tactile_node.cli.main', 'bringup', '--pads', 'left,right', '--node-id', '32,40',
             '--namespace', f'gripper{number}', '--autostart', 'false']
    network = {'PYTHONPATH': str(ROOT), 'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4',
               'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}
    return subprocess.Popen(words, cwd=ROOT, env=os.environ | network, stdout=subprocess.DEVNULL,
                            stderr=subprocess.DEVNULL)


def wait_until_ready(processes: list[subprocess.Popen]) -> None:
    """Until each has the port at which discovery reaches it."""
    end = time.monotonic() + START_TIMEOUT
    while participants() < len(processes):
        if time.monotonic() > end or any(process.poll() is not None for process in processes):
            raise SystemExit('expected that all grippers start')
        time.sleep(0.5)


def participants() -> int:
    """Unicast ports of discovery in this namespace: 7400 + 250 domain + 10 + 2 participant (RTPS 2.2, 9.6.1.1)."""
    base = 7400 + 250 * int(os.environ.get('ROS_DOMAIN_ID', '0'))
    ports = {int(line.split()[1].split(':')[1], 16) for line in Path('/proc/net/udp').read_text().splitlines()[1:]}
    return sum(base + 10 + 2 * number in ports for number in range(120))


def carried() -> int:
    line = next(line for line in COUNTERS.read_text().splitlines() if line.strip().startswith('lo:'))
    return int(line.split(':')[1].split()[8])  # sent


if __name__ == '__main__':
    sys.exit(main())
