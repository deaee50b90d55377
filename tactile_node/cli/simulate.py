"""`tactile simulate` runs a simulated CANopen skin, on a CAN bus or behind a pseudo-terminal (slcan).

Like a real skin, the simulated skin sends no TPDOs until a CANopen master, such as the driver, starts it. Behind a
pseudo-terminal, the simulator reproduces the timing of a CAN bus at the bit rate --bitrate. CAN frames compete by
arbitration, and each CAN frame is delivered when a real bus would have delivered it. On exit and on each SIGUSR1, the
simulator reports the bus traffic since the last report and its own lateness.
"""

import argparse
import gc
import json
import signal

import can

from tactile_node.bus.open_bus import open_bus
from tactile_node.cli.options import add_bus_options, add_number, add_skin_options, live_pads_of
from tactile_node.interruption import interruption
from tactile_node.simulator.device import TaxelSource
from tactile_node.simulator.figures import NAMED
from tactile_node.simulator.skin_simulator import SkinSimulator, WireSettings
from tactile_node.simulator.slcan_pty import SlcanPty
from tactile_node.simulator.touches import TOUCH_HOLD, TOUCH_PAUSE, gripper_sources
from tactile_node.simulator.world import CLASSES
from tactile_node.skin.pads import PadSettings

MOST_DELAY = 1.0  #: maximum value of --delay, --jitter and --batch [s]


def add_options(parser: argparse.ArgumentParser) -> None:
    add_bus_options(parser, channel='vcan0')
    parser.add_argument('--pty', action='store_true', help='offer an slcan adapter on a pseudo-terminal instead')
    parser.add_argument('--link', default='', metavar='PATH',
                        help='symbolic link to the pseudo-terminal; only with --pty. A link that another simulator '
                        'uses is not replaced')
    _add_wire_options(parser)
    add_skin_options(parser)
    parser.add_argument('--shapes', nargs='+', default=CLASSES, choices=(*CLASSES, *NAMED), metavar='SHAPE',
                        help='shapes that touch the pads: %(choices)s (default: the first five)')
    add_number(parser, '--areas', limits={'above': 0}, nargs='+', default=(), metavar='TAXELS',
               help='areas of the contacts [taxels] (default: 40 60 80, and less on a pad with fewer than 16 rows or '
               'columns)')
    add_number(parser, '--rounds', int, limits={'least': 1}, default=1, metavar='N', help='number of touches for each '
               'shape and area, each at a different place and angle, before the sequence repeats (default: '
               '%(default)s)')
    parser.add_argument('--seed', type=int, default=0, help='seed of the random touches (default: %(default)s)')
    add_number(parser, '--hold', limits={'above': 0, 'unit': 's'}, default=TOUCH_HOLD, metavar='SECONDS',
               help='duration of each contact [s] (default: %(default)s)')
    add_number(parser, '--pause', limits={'unit': 's'}, default=TOUCH_PAUSE, metavar='SECONDS',
               help='pause between two contacts [s] (default: %(default)s, long enough for `tactile tare`)')
    parser.add_argument('--duration', type=float, help='end after this time [s] (default: end at Ctrl-C)')


def _add_wire_options(parser: argparse.ArgumentParser) -> None:
    default = WireSettings()
    parser.add_argument('--wire', action=argparse.BooleanOptionalAction, default=None,
                        help='reproduce the timing of a CAN bus (default with --pty), or send each sweep at once')
    limits = {'most': MOST_DELAY, 'unit': 's'}
    add_number(parser, '--delay', limits=limits, default=default.delay, metavar='S',
               help='time from the end of a SYNC until the device has its TPDOs ready [s] (default: %(default)s)')
    add_number(parser, '--jitter', limits=limits, default=default.jitter, metavar='S',
               help='largest random time that is added to --delay [s] (default: %(default)s)')
    add_number(parser, '--batch', limits=limits, default=default.batch, metavar='S', help='longest time for which a '
               'frame is held back and then delivered with the next frames, as by a USB adapter [s] (default: '
               '%(default)s)')
    parser.add_argument('--report', metavar='FILE',
                        help='append each report to this file as a line of JSON, instead of printing it')


def _wire(args: argparse.Namespace) -> WireSettings | None:
    if not (args.pty if args.wire is None else args.wire):
        return None
    return WireSettings(args.bitrate, args.delay, args.jitter, batch=args.batch, seed=args.seed)


def run(args: argparse.Namespace) -> int:
    """Run until interrupted. Return 1 if the bus failed, else 0."""
    pads = live_pads_of(args)
    nodes = [str(node_id) for pad in pads for node_id in pad.node_ids]
    failures: list[Exception] = []
    with interruption() as stop_requested:
        def on_failure(error: Exception) -> None:
            failures.append(error)
            stop_requested.set()
        simulator = SkinSimulator(pads, _sources(args, pads), on_failure, _wire(args))
        before = signal.signal(signal.SIGUSR1, lambda *_: _report(simulator, args.report))
        bus, place = _open(args)
        simulator.start_on(bus)
        print(f'Simulated skin, node {", ".join(nodes)}, at {place}', flush=True)
        gc.freeze()  # a full garbage collection would delay a sweep by about 40 ms
        stop_requested.wait(args.duration)
        signal.signal(signal.SIGUSR1, signal.SIG_IGN)
        _report(simulator, args.report)
        simulator.stop()
        signal.signal(signal.SIGUSR1, before)
    if failures:
        print(f'The bus failed: {failures[0]}')
    return 1 if failures else 0


def _report(simulator: SkinSimulator, file: str | None) -> None:
    report = simulator.report()
    if report is None:
        return
    if not file:
        print(report.text(), flush=True)
        return
    with open(file, 'a', encoding='utf-8') as stream:
        stream.write(json.dumps(report._asdict()) + '\n')


def _open(args: argparse.Namespace) -> tuple[can.BusABC, str]:
    """Return the bus, and the channel or port to which a driver connects."""
    if args.pty:
        adapter = SlcanPty(args.link)
        return adapter, adapter.port
    return open_bus(args.interface, args.channel, args.bitrate), args.channel


def _sources(args: argparse.Namespace, pads: tuple[PadSettings, ...]) -> dict[str, TaxelSource]:
    return gripper_sources(pads, args.shapes, args.seed, tuple(args.areas), rounds=args.rounds, hold=args.hold,
                           pause=args.pause)
