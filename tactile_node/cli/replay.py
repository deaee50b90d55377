"""``tactile replay``: play a CAN log without ROS; taxel frames as .npy, and the fate of every CAN frame."""

import argparse
import sys
from pathlib import Path

import numpy as np

from tactile_node.canbus.layout_file import load_layout
from tactile_node.canbus.log_source import LogSource
from tactile_node.canbus.pads import PadSettings
from tactile_node.canbus.router import BusStatistics
from tactile_node.interruption import interruption
from tactile_node.errors import LogError


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('replay', help='play a CAN log without ROS')
    parser.add_argument('log', help='CAN log: .log (candump), .log.gz, .asc, .blf, .trc...')
    parser.add_argument('--layout', default='sim16x16.yaml', help='skin layout (default: %(default)s)')
    parser.add_argument('--node-id', type=int, action='append', help='repeat for more pads (default: 32)')
    parser.add_argument('--pace', type=float,
                        help='1: as recorded, 2: twice as fast (default: as fast as possible)')
    parser.add_argument('--output', metavar='FILE', help='.npy of shape (K, rows, cols), NaN = invalid; '
                        '- is standard output; with more pads the name gets _pad32 and so on')
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Play the log to its end; 1 when it held no taxel frame or was interrupted."""
    layout = load_layout(args.layout)
    pads = tuple(PadSettings(f'pad{node}', node, layout) for node in args.node_id or [32])
    frames: dict[str, list[np.ndarray]] = {pad.name: [] for pad in pads}
    source = LogSource(args.log, pads, lambda name, frame: frames[name].append(frame.values), args.pace)
    with interruption() as asked:
        source.open()
        source.start()
        while not source.finished.wait(0.1) and not asked.is_set():
            pass
        source.close()
    if source.failure:
        raise LogError(args.log, expected='a log to its end', got=source.failure, remedy='Record it again.')
    print(summary(source.statistics()), file=sys.stderr if args.output == '-' else sys.stdout)
    if args.output:
        _save(args.output, frames)
    return 0 if source.finished.is_set() and any(frames.values()) else 1


def summary(statistics: BusStatistics) -> str:
    """A table of what was published and where every CAN frame went."""
    lines = []
    for name, pad in statistics.pads.items():
        losses = ', '.join(f'{n} {reason}' for reason, n in pad.losses.items() if n) or 'none lost'
        lines.append(f'{name}: {pad.published} taxel frames, {pad.complete} complete, '
                     f'{pad.incomplete} incomplete; TPDOs: {pad.expected} expected, {pad.received} received, '
                     f'{pad.used} used, {losses}')
    services = ', '.join(f'{count} {service}' for service, count in sorted(statistics.can_frames.items()))
    total = sum(statistics.can_frames.values())
    lines.append(f'CAN frames: {total} ({services}); lines unread: {statistics.unread}')
    return '\n'.join(lines)


def _save(output: str, frames: dict[str, list[np.ndarray]]) -> None:
    path = Path(output)
    for name, values in frames.items():
        if output == '-':
            np.save(sys.stdout.buffer, np.array(values))
        else:
            np.save(path if len(frames) == 1 else path.with_name(f'{path.stem}_{name}{path.suffix}'),
                    np.array(values))
