"""What each topic costs on the link between two hosts, and what each split of the nodes needs.

    python bench/hosts_table.py [--seconds 10] [--rate 20]

Two pads of 16x16 taxels hold an object, at a rate that a busy machine keeps. Octets are those of the interface: with
IP, UDP, RTPS and acknowledgements, both directions, less what passes while nothing is subscribed. Latency is from SYNC
to the subscriber on the second host, both on one clock.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parents[1] / folder) for folder in ('.', 'test')]

from hosts_bench import HostsWorld
from misled_skin import PADS
from two_hosts import Hosts

from tactile_node.node_graph import frame_topics

FULL_RATE = 50.0  # Hz
METER = Path(__file__).with_name('topic_meter.py')
LEFT, GRASP, SHAPE = f'/{PADS[0]}/', '/grasp', f'/{PADS[0]}/shape'
OTHERS = {'/left/pose': 'geometry_msgs/msg/PoseWithCovarianceStamped', '/left/shapes': 'tactile_skin/msg/ContactShapes',
          '/skin_driver/status': 'tactile_skin/msg/SkinStatus', '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray'}
ONCE_A_SECOND = '/skin_driver/status', '/diagnostics'


class Load(NamedTuple):
    """Of the link, while topics are subscribed."""

    rate: float  #: octets a second, both directions
    topics: dict[str, dict]  #: as topic_meter.py prints them
    seconds: float


class BusHost(HostsWorld):
    """All nodes on the first host, and a reader of the grasp: nothing is subscribed on the second."""

    has_sides = False

    def __init__(self, hosts: Hosts, period: float):
        super().__init__(hosts, topics=(), here=('grasp=grasp',), period=period)

    def start(self, side: str) -> None:
        if side == 'bus':
            super().start(side)

    def hold(self, seconds: float = 1.0) -> None:
        self.wait(lambda: self.here_records[-1].get('stable'), 'a stable grasp')


def measured(world: HostsWorld, seconds: float, topics: dict[str, str]) -> Load:
    """Subscribe to ``topics`` on the second host for so long."""
    words = [f'{topic}={kind}' for topic, kind in topics.items()]
    command = [sys.executable, str(METER), str(seconds), *words]
    with world.on_second(command, stdout=subprocess.PIPE, text=True) as meter:
        begun, ended, *lines = meter.communicate()[0].splitlines()
    before, after = (np.array(line.split()[1:], dtype=float) for line in (begun, ended))
    took, *octets = after - before
    return Load(sum(octets) / took, {row['topic']: row for row in map(json.loads, lines)}, took)


def milliseconds(row: dict) -> list[str]:
    """Latency p50, p99."""
    latencies = [each for each in row['latencies'] if np.isfinite(each)]
    return [f'{1e3 * np.percentile(latencies, part):.1f}' if latencies else '' for part in (50, 99)]


def topic_table(hosts: Hosts, seconds: float, rate: float) -> None:
    topics = {topic: kind for topic, kind in frame_topics(PADS).items() if topic.startswith(LEFT) or topic == GRASP}
    print_row('topic', 'a second', 'octets of a message', 'on the link', 'kB/s at 50 Hz', 'latency p50 [ms]', 'p99')
    print_row(*['---'] * 7)
    with BusHost(hosts, 1 / rate) as world:
        world.hold()
        quiet = measured(world, seconds, {}).rate
        for topic, kind in (topics | OTHERS).items():
            load = measured(world, seconds, {topic: kind})
            row = load.topics[topic]
            if not row['count']:
                print_row(topic.removeprefix(LEFT), '0')
                continue
            frames = FULL_RATE * (len(PADS) if topic == GRASP else 1)  # a grasp for each shape of either pad
            octets, a_second = (load.rate - quiet) * load.seconds / row['count'], row['count'] / load.seconds
            print_row(topic.removeprefix(LEFT), f'{a_second:.1f}', row['octets'] // row['count'], f'{octets:.0f}',
                      f'{1e-3 * octets * (a_second if topic in ONCE_A_SECOND else frames):.1f}', *milliseconds(row))
        print(f'\nWhile nothing is subscribed: {1e-3 * quiet:.1f} kB/s.\n')


def split_table(hosts: Hosts, seconds: float, rate: float) -> None:
    print_row('nodes of the bus host', f'kB/s on the link at {rate:.0f} Hz', 'shape p50 [ms]', 'p99', 'grasp p50',
              'p99')
    print_row(*['---'] * 6)
    topics = {name: kind for name, kind in frame_topics(PADS).items() if name in (SHAPE, GRASP)}
    for nodes, make in (('driver', lambda: HostsWorld(hosts, topics=('grasp=grasp',), period=1 / rate)),
                        ('all', lambda: BusHost(hosts, 1 / rate))):
        with make() as world:
            world.hold()
            load = measured(world, seconds, topics)
            print_row(nodes, f'{1e-3 * load.rate:.0f}', *milliseconds(load.topics[SHAPE]),
                      *milliseconds(load.topics[GRASP]))


def print_row(*cells: object) -> None:
    print('| ' + ' | '.join(map(str, cells)) + ' |', flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seconds', type=float, default=10.0, help='of each measurement (default: 10)')
    parser.add_argument('--rate', type=float, default=20.0, help='frames of a pad in a second (default: 20)')
    args = parser.parse_args()
    print(f'Two pads of 16x16 taxels, {args.rate:.0f} frames a second each; topics of one pad.\n')
    with Hosts() as hosts:
        topic_table(hosts, args.seconds, args.rate)
        split_table(hosts, args.seconds, args.rate)
    return 0


if __name__ == '__main__':
    sys.exit(main())
