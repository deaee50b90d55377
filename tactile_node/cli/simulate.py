"""``tactile simulate``: a CANopen skin made of software, on a CAN bus or behind a pseudo-terminal (slcan).

It is as silent as a real one until a master (the driver) starts it.
"""

import argparse
import gc

from tactile_node.bus.bus_network import open_bus
from tactile_node.bus.bus_settings import DEFAULT_BITRATE
from tactile_node.cli.options import names, node_ids
from tactile_node.errors import ConfigurationError
from tactile_node.interruption import interruption
from tactile_node.simulator.device import TaxelSource
from tactile_node.simulator.gripper import gripper_sources
from tactile_node.simulator.recording import SIDE, load_recording
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.simulator.slcan_pty import SlcanPty
from tactile_node.skin.pads import PadSettings, make_pads, with_dictionaries
from tactile_node.synthetic.world import CLASSES


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('simulate', help='be a CANopen skin that touches shapes or repeats a recording',
                                   description=__doc__)
    parser.add_argument('--interface', default='socketcan', help='python-can interface (default: %(default)s)')
    parser.add_argument('--channel', default='vcan0', help='its channel (default: %(default)s)')
    parser.add_argument('--bitrate', type=int, default=DEFAULT_BITRATE, help='[bit/s] (default: %(default)s)')
    parser.add_argument('--pty', action='store_true', help='offer an slcan adapter on a pseudo-terminal instead')
    parser.add_argument('--link', default='', metavar='PATH', help='with --pty: a symbolic link to the port')
    parser.add_argument('--layout', type=names, default=['sim16x16.yaml'], metavar='LAYOUT,...',
                        help='skin layout of each pad, or one for all (default: sim16x16.yaml)')
    parser.add_argument('--eds', type=names, default=[], metavar='EDS,...',
                        help="EDS of each pad, or one for all (default: the layout's name with .eds)")
    parser.add_argument('--node-id', type=node_ids, action='extend', metavar='ID,...',
                        help='node-ID of each pad (default: 32)')
    parser.add_argument('--shapes', nargs='+', choices=CLASSES, default=CLASSES, help='what touches (default: all)')
    parser.add_argument('--seed', type=int, default=0, help='of the touches (default: %(default)s)')
    parser.add_argument('--recording', metavar='FILE', help='repeat this event recording (64x64 layout) instead')
    parser.add_argument('--duration', type=float, help='end after so many seconds (default: at Ctrl-C)')
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run until interrupted; 1 when the bus fails meanwhile."""
    nodes = args.node_id or [32]
    pads = with_dictionaries(make_pads(args.layout, nodes), args.eds or [''])
    failures: list[Exception] = []
    with interruption() as asked:
        simulator = SkinSimulator(pads, _sources(args, pads), lambda error: (failures.append(error), asked.set()))
        bus = SlcanPty(args.link) if args.pty else open_bus(args.interface, args.channel, args.bitrate, {})
        simulator.start_on(bus)
        print(f'Simulated skin, node {", ".join(map(str, nodes))}, at {bus.port if args.pty else args.channel}',
              flush=True)
        gc.freeze()  # a full collection would hold up a sweep for some 40 ms
        asked.wait(args.duration)
        simulator.stop()
    if failures:
        print(f'The bus has failed: {failures[0]}')
    return 1 if failures else 0


def _sources(args: argparse.Namespace, pads: tuple[PadSettings, ...]) -> dict[str, TaxelSource]:
    if not args.recording:
        return gripper_sources(pads, tuple(args.shapes), args.seed)
    for pad in pads:
        if (pad.layout.rows, pad.layout.cols) != (SIDE, SIDE):
            raise ConfigurationError('--recording', expected=f'a layout of {SIDE}x{SIDE} taxels',
                                     got=pad.layout.source, remedy='Add --layout nus_sinapse_64x64.yaml.')
    return dict.fromkeys((pad.name for pad in pads), load_recording(args.recording).at)
