"""``tactile record``: write everything on a CAN bus to a log, candump's or any other python-can knows."""

import argparse
import time

from tactile_node.canbus.bus_network import open_bus
from tactile_node.canbus.logs import CanLogWriter
from tactile_node.interruption import interruption
from tactile_node.errors import BusError


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('record', help='record a CAN log from a live bus')
    parser.add_argument('file',
                        help='log to write, format by suffix: .log (candump), .log.gz, .asc, .blf, .trc')
    parser.add_argument('--interface', default='socketcan',
                        help='python-can interface (default: %(default)s)')
    parser.add_argument('--channel', default='can0', help='its channel (default: %(default)s)')
    parser.add_argument('--bitrate', type=int, default=1_000_000, help='[bit/s] (default: %(default)s)')
    parser.add_argument('--duration', type=float, default=float('inf'), help='[s] (default: until Ctrl-C)')
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Record until interrupted; 1 when there was nothing to record."""
    bus = open_bus(args.interface, args.channel, args.bitrate, {})
    try:
        log = CanLogWriter(args.file)
        try:
            _record(bus, log, args.duration)
        finally:
            log.close()
    finally:
        bus.shutdown()
    print(f'{log.can_frames} CAN frames in {args.file}')
    return 0 if log.can_frames else 1


def _record(bus: object, log: CanLogWriter, duration: float) -> None:
    end = time.monotonic() + duration
    with interruption() as asked:
        while not asked.is_set() and time.monotonic() < end:
            try:
                message = bus.recv(0.1)
            except Exception as error:  # each backend raises its own when the adapter goes
                raise BusError(bus.channel_info, expected='to go on receiving', got=str(error),
                               remedy='What was received so far is in the log. Check the adapter.') from error
            if message is not None:
                log.write(message)
