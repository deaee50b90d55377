"""`tactile tare`: take the present readings of the pads, with nothing on them, as their zero.

The running driver does it, one pad after another. It refuses a pad that is pressed; then this command tries again for
as long as --wait says. Exit code 1: a pad is not tared.
"""

import argparse
import sys
import time

from tactile_node.cli.options import add_number, pad_names
from tactile_node.errors import TareRefusal

DEFAULT_WAIT = 10.0  #: time for which the command tries again [s]
PRESSED = TareRefusal.PRESSED, TareRefusal.CONTACT


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--pads', type=pad_names, metavar='NAME,...', help='names of the pads (default: all of the '
                        'driver)')
    add_number(parser, '--frames', int, limits={'least': 1}, default=0, metavar='N',
               help='taxel frames to average (default: as the driver has it, 50)')
    parser.add_argument('--on-device', action='store_true', help='let the device zero itself first (CiA 404, 0x6125)')
    add_number(parser, '--wait', limits={'unit': 's'}, default=DEFAULT_WAIT, metavar='SECONDS', help='time for which '
               'the command tries again while something presses a pad (default: %(default)s)')
    parser.add_argument('--namespace', default='', help='of the driver')


def run(args: argparse.Namespace) -> int:
    """Tare each pad; 1 when one is not tared."""
    from tactile_node.nodes.tare_client import tare_client  # rclpy: only where it is needed
    is_done = True
    with tare_client(args.namespace) as client:
        for pad in args.pads or client.pads():
            end = time.monotonic() + args.wait
            answer = client.tare(pad, args.frames, args.on_device)
            if answer.refusal in PRESSED and args.wait:
                print(f'tactile: {answer.message}\ntactile: trying again for {args.wait:g} s', file=sys.stderr)
            while answer.refusal in PRESSED and time.monotonic() < end:
                answer = client.tare(pad, args.frames, args.on_device)
            is_done &= answer.success
            print(answer.message if answer.success else f'tactile: error: {answer.message}',
                  file=sys.stdout if answer.success else sys.stderr, flush=True)
    return 0 if is_done else 1
