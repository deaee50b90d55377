"""`tactile tare` sets the zero of the pads to their current readings, so nothing may touch the pads.

The running driver tares one pad after another. The driver refuses to tare a pad that is pressed. If a pad is pressed,
the command retries for up to --wait seconds. The exit code is 1 if a pad was not tared.
"""

import argparse
import sys
import time

from tactile_node.cli.options import add_number, pad_names
from tactile_node.errors import TareRefusal

DEFAULT_WAIT = 10.0  #: time for which the command retries [s]
PRESSED = TareRefusal.PRESSED, TareRefusal.CONTACT


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--pads', type=pad_names, metavar='NAME,...', help='names of the pads (default: all pads of '
                        'the driver)')
    add_number(parser, '--frames', int, limits={'least': 1}, default=0, metavar='N',
               help="number of taxel frames to average (default: the driver's parameter, 50)")
    parser.add_argument('--on-device', action='store_true', help='let the device zero itself first (CiA 404, 0x6125)')
    add_number(parser, '--wait', limits={'unit': 's'}, default=DEFAULT_WAIT, metavar='SECONDS', help='time for which '
               'the command retries while a pad is pressed [s] (default: %(default)s)')
    parser.add_argument('--namespace', default='', help='namespace of the driver')


def run(args: argparse.Namespace) -> int:
    """Tare each pad. Return 1 if a pad was not tared, else 0."""
    from tactile_node.nodes.tare_client import tare_client  # a late import, because `--help` must work without ROS
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
            if answer.refusal in PRESSED and args.wait:
                print('tactile: If the pad is touched only now and then, average fewer frames, so that a try fits '
                      'between two touches, for example --frames 10.', file=sys.stderr)
            print(answer.message if answer.success else f'tactile: error: {answer.message}',
                  file=sys.stdout if answer.success else sys.stderr, flush=True)
    return 0 if is_done else 1
