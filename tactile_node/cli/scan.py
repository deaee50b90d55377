"""`tactile scan` lists the CANopen nodes on a bus with their states and the matching layouts in config/.

The command reads a few objects of each node by SDO and writes nothing. With --passive, the command only listens. With
--bitrate auto, the command first finds the bit rate by listening for --listen seconds at each of eight bit rates.
Listen-only mode keeps the search from disturbing the bus.
"""

import argparse
import json
import sys
from pathlib import Path

from tactile_node.bus.node_scan import FoundNode, NodeScan, find_bit_rate
from tactile_node.cia301.objects import MAX_NODE_ID, MIN_NODE_ID, state_name
from tactile_node.cli.options import add_bus_options, add_number, node_ids, open_network
from tactile_node.errors import ConfigurationError
from tactile_node.interruption import interruption
from tactile_node.package_files import config_path
from tactile_node.skin.eds import load_eds
from tactile_node.skin.eds_rules import Identity, identity_of

LONGEST_LISTENING = 86_400.0  #: maximum value of --listen [s]
LISTENING_TIME = 1.5  #: default of --listen [s], because most nodes send a heartbeat at least once per second
SILENT_HINT = 'Nothing was received, and no node answered. Check power, termination, bit rate and cable.'
SILENT_PASSIVE_HINT = 'Nothing was received. A node without a heartbeat is found only without --passive.'
DAMAGED_HINT = ('Only damaged CAN frames were received: {} error frames. Check the bit rate, the termination, and that '
                'the adapter speaks slcan.')
UNHEARD_HINT = 'CAN frames were received, but no node was found. Check the bit rate and the node-IDs of --node-id.'


def add_options(parser: argparse.ArgumentParser) -> None:
    add_bus_options(parser, finds_bit_rate=True)
    parser.add_argument('--node-id', type=node_ids, action='extend', metavar='ID,...',
                        help='ask only these node-IDs (default: all)')
    add_number(parser, '--listen', limits={'above': 0, 'most': LONGEST_LISTENING, 'unit': 's'}, default=LISTENING_TIME,
               metavar='SECONDS', help='time to listen before asking [s] (default: %(default)s)')
    parser.add_argument('--passive', action='store_true', help='send nothing; only listen to heartbeats')
    parser.add_argument('--eds', action='append', default=[], metavar='FOLDER',
                        help='also compare the nodes with the EDS files in this folder, besides those in config/')
    parser.add_argument('--json', action='store_true', help='print one line of JSON per node')


def run(args: argparse.Namespace) -> int:
    """Print the nodes. Return 1 if no node was found, else 0."""
    for folder in args.eds:
        if not Path(folder).is_dir():
            raise ConfigurationError('--eds', expected='a folder', got=repr(folder), remedy='Check the path.')
    if args.bitrate is None:
        args.bitrate = find_bit_rate(args.interface, args.channel, args.listen)
        if not args.json:
            print(f'bit rate: {args.bitrate} bit/s')
    known = _known([config_path('sim16x16.eds').parent, *map(Path, args.eds)])
    scan = NodeScan()
    with open_network(args, scan.received) as network, interruption() as stop_requested:
        stop_requested.wait(args.listen)
        if not args.passive:
            scan.ask(network, args.node_id or range(MIN_NODE_ID, MAX_NODE_ID + 1))
        found = scan.nodes(None if args.passive else network)
    for node in found:
        matching = [path for path, identity in known if any(node.identity) and identity.accepts(node.identity)]
        is_asked = not args.passive and node.node_id in (args.node_id or [node.node_id])
        facts = {'bitrate': args.bitrate, **as_json(node, matching)}
        print(json.dumps(facts) if args.json else _text(node, matching, is_asked))
    if not found:
        silent = SILENT_PASSIVE_HINT if args.passive else SILENT_HINT
        damaged = DAMAGED_HINT.format(scan.error_frames) if scan.error_frames else silent
        print(UNHEARD_HINT if scan.can_frames else damaged, file=sys.stderr)
    return 0 if found else 1


def as_json(node: FoundNode, matching: list[Path]) -> dict:
    """Return the facts about a node as a JSON-compatible dict, with None for unknown facts.

    Parameters
    ----------
    node
        The node to describe.
    matching
        EDS files that match the identity of the node.
    """
    return {**node._asdict(), 'state': None if node.state is None else state_name(node.state),
            'identity': node.identity._asdict(), 'eds': [str(path) for path in matching],
            'layouts': [str(path) for path in map(_layout, matching) if path.is_file()]}


def _text(node: FoundNode, matching: list[Path], is_asked: bool) -> str:
    heartbeat = ('no heartbeat heard' if node.heartbeat_period is None
                 else f'heartbeat every {1000 * node.heartbeat_period:.0f} ms')
    name = repr(node.name) if node.name else 'no name'
    state = 'state not known' if node.state is None else state_name(node.state)
    if not node.answers:
        return f'node {node.node_id}: {state}, {heartbeat}, {"no answer by SDO" if is_asked else "not asked"}'
    layouts = ', '.join(path.name for path in map(_layout, matching) if path.is_file())
    doubled = '; several devices have this node-ID, so give each its own' if node.is_doubled else ''
    return (f'node {node.node_id}: {name}, {node.identity}; {state}, {heartbeat}; '
            + (f'layout {layouts}' if layouts else 'no layout of ours') + doubled)


def _layout(eds: Path) -> Path:
    return eds.with_suffix('.yaml')


def _known(folders: list[Path]) -> list[tuple[Path, Identity]]:
    """Return the EDS files that contain an identity, with that identity. Report unreadable files on stderr."""
    found = []
    for path in sorted(path for folder in folders for path in folder.glob('*.[eE][dD][sS]')):
        try:
            identity = identity_of(load_eds(path, MIN_NODE_ID), str(path))
        except ConfigurationError as error:
            print(f'tactile: {error}', file=sys.stderr)
            continue
        if any(identity[:2]):
            found.append((path, identity))
    return found
