"""Which buses, pads, rates and processes bench_pads.py measures, and the processes of each."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tactile_node.node_graph import NodeDescription, bus_nodes

ROOT = Path(__file__).resolve().parents[1]
LAYOUT, TPDOS = 'sim16x16.yaml', 32  #: of a sweep of one pad
NODE_IDS = 32, 40, 48, 56  #: 16x16 taxels use the TPDO ranges of eight node-IDs
FORMS = 'one', 'per_bus', 'per_node'
RATES = {50: (1, 2, 3, 4), 100: (1, 2)}  #: SYNCs a second: pads that a bus of 1 Mbit/s carries
BUSES = 1, 2, 4, 8
MOST_PROCESSES = 40  #: of nodes: more take minutes to start on two cores
FRAME, SYNC, BITRATE = 135, 55, 1e6  #: bits of a TPDO of 8 bytes and of SYNC with the most stuff bits (ISO 11898-1)
DELAY = 0.0003  #: s from SYNC to the first TPDO of the simulated skin


class Case(NamedTuple):
    """``pads``: of each bus; ``rate``: SYNCs a second."""

    form: str
    buses: int
    pads: int
    rate: int

    @property
    def all_pads(self) -> int:
        return self.buses * self.pads

    @property
    def load(self) -> float:
        """Of each wire, 0..1."""
        return self.rate * (SYNC + self.pads * TPDOS * FRAME) / BITRATE

    @property
    def sweep_ends(self) -> tuple[float, ...]:
        """When the last TPDO of each pad has been on the wire, since its SYNC was sent [s].

        All pads answer at once. Each sends eight TPDOs of each of the four ranges 0x180, 0x280, 0x380, 0x480 in their
        order; the lower identifier goes first, so that no pad ends before all have sent those of three ranges.
        """
        begin = SYNC / BITRATE + DELAY
        return tuple(begin + (24 * self.pads + 8 * (place + 1)) * FRAME / BITRATE for place in range(self.pads))

    @property
    def processes(self) -> int:
        return {'one': 1, 'per_bus': self.buses, 'per_node': self.buses * len(self.nodes(0, ''))}[self.form]

    def names(self) -> list[str]:
        return [f'pad{place}' for place in range(self.pads)]

    def nodes(self, bus: int, channel: str, layout: str = LAYOUT) -> tuple[NodeDescription, ...]:
        """The nodes of one bus, as `tactile bringup` starts them."""
        driver = {'interface': 'slcan', 'channel': channel, 'node_ids': list(NODE_IDS[:self.pads]),
                  'layouts': [layout], 'sync_period': 1 / self.rate}
        return bus_nodes(self.names(), driver=driver, namespace=namespace(bus))

    def commands(self, channels: Sequence[str], layout: str = LAYOUT) -> list[list[str]]:
        """One for each process; ``channels``: one for each bus."""
        if self.form == 'one':
            return [[sys.executable, str(ROOT / 'bench/pads_process.py'), layout, *map(str, self[1:]), *channels]]
        found = []
        for bus, channel in enumerate(channels):
            words = [sys.executable, '-m', 'tactile_node.cli.main', 'bringup', '--interface', 'slcan', '--channel',
                     channel, '--pads', ','.join(self.names()), '--node-id', ','.join(map(str, NODE_IDS[:self.pads])),
                     '--layout', layout, '--namespace', namespace(bus)]
            period = ['--ros-args', '-p', f'sync_period:={1 / self.rate}']  # of the driver; no other node has it
            found += ([executable(node) for node in self.nodes(bus, channel, layout)] if self.form == 'per_node'
                      else [[*words, *period]])
        return found


def executable(node: NodeDescription) -> list[str]:
    """Return the command for one node, as `ros2 run` starts it."""
    given = (word for name, value in node.parameters.items() for word in ('-p', f'{name}:={json.dumps(value)}'))
    return [sys.executable, '-m', f'tactile_node.nodes.{node.role.value}_node', '--ros-args', '-r',
            f'__ns:=/{node.namespace}', *given]


def namespace(bus: int) -> str:
    return f'bus{bus}'


#: the default, in at most 15 minutes: each form up to the end of two cores
SHORT = (*(Case('one', buses, pads, 50) for buses, pads in ((1, 1), (1, 2), (1, 3), (1, 4), (2, 1), (2, 2), (4, 1),
                                                            (8, 1))), Case('one', 1, 1, 100), Case('one', 1, 2, 100),
         *(Case('per_bus', buses, pads, 50) for buses, pads in ((2, 1), (2, 2), (2, 4), (4, 1), (8, 1))),
         *(Case('per_node', buses, pads, 50) for buses, pads in ((1, 1), (1, 2), (1, 4), (2, 1), (4, 1))))
SLOW = 10  #: SYNCs a second
#: so slow that two cores keep up: how cost grows is measured where nothing is left out
GROWTH = (*(Case('one', buses, pads, SLOW) for buses, pads in ((1, 1), (1, 2), (1, 4), (2, 1), (2, 2), (4, 1), (8, 1))),
          *(Case('per_bus', buses, pads, SLOW) for buses, pads in ((2, 1), (2, 2), (4, 1), (4, 2), (8, 1))))
FULL = tuple(Case(form, buses, pads, rate) for rate, counts in RATES.items() for buses in BUSES for pads in counts
             for form in FORMS if not (form == 'per_bus' and buses == 1))  # that is the one process
