"""`tactile record` writes every frame on a CAN bus to a log, in the format of candump or as a ROS 2 bag."""

import argparse
import sys
import time
from contextlib import suppress

import can

from tactile_node.bus.open_bus import open_bus
from tactile_node.cli.options import add_bus_options, add_number, add_output_option
from tactile_node.errors import BusError, LogError
from tactile_node.interruption import interruption
from tactile_node.logs.log_writer import MEGABYTE, CanLogWriter
from tactile_node.logs.series import files_of
from tactile_node.output_file import check_new, check_writable

HINT_DELAY = 3.0  #: time without CAN frames after which a hint is printed [s]
SILENCE_HINT = ('Nothing was received so far. A CANopen skin is silent until a master starts it. Run the driver on the '
                'same bus, or let the driver record: tactile bringup --record FILE.')


def add_options(parser: argparse.ArgumentParser) -> None:
    add_output_option(parser, 'file', help='log to write; the suffix decides the format: .log (candump), .log.gz or '
                      '.mcap (ROS 2 bag)')
    add_bus_options(parser)
    parser.add_argument('--duration', type=float, default=float('inf'),
                        help='length of the recording [s] (default: until Ctrl-C)')
    add_number(parser, '--rotate-mb', limits={'remedy': '0 makes one file.'}, default=0.0, metavar='N',
               help='file size at which a new file begins, named FILE_part2 and so on [MB] (default: one file)')


def run(args: argparse.Namespace) -> int:
    """Record until interrupted. Return 1 if no CAN frame was received, else 0."""
    check_writable(args.file, force=args.force)
    for path in files_of(args.file):
        check_new(path, force=args.force)
    bus = open_bus(args.interface, args.channel, args.bitrate)
    try:
        log = CanLogWriter(args.file, args.channel, round(args.rotate_mb * MEGABYTE), replaces=args.force)
        try:
            _record(bus, log, args.duration)
        finally:
            log.close()
    finally:
        with suppress(can.CanError, OSError):  # the adapter was unplugged
            bus.shutdown()
    if log.failure:
        raise LogError(str(log.path), expected='enough disk space for the recording', got=log.failure,
                       remedy='The frames written before the error can still be read.')
    parts = f' and {log.parts - 1} files after it' if log.parts > 1 else ''
    print(f'{log.can_frames} CAN frames in {log.path}{parts}')
    if log.unwritten:
        print(f'{log.unwritten} CAN FD frames left out, because the log format cannot hold them.', file=sys.stderr)
    return 0 if log.can_frames else 1


def _record(bus: can.BusABC, log: CanLogWriter, duration: float) -> None:
    end = time.monotonic() + duration
    hint_at: float | None = time.monotonic() + HINT_DELAY
    with interruption() as stop_requested:
        while not stop_requested.is_set() and not log.failure and time.monotonic() < end:
            try:
                message = bus.recv(0.1)
            except Exception as error:  # each backend raises a different error when an adapter is unplugged
                raise BusError(bus.channel_info, expected='to continue receiving', got=str(error),
                               remedy='The log contains all frames received so far. Check the adapter.') from error
            if message is not None:
                log.write(message)
            elif hint_at is not None and time.monotonic() > hint_at and not log.can_frames:
                print(SILENCE_HINT, file=sys.stderr)
                hint_at = None
