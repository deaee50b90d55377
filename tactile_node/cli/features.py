"""`tactile features`: every quantity of the paper, by the names of tactile_node.helmholtz.features."""

import argparse

from tactile_node.cli.arrays import (
    add_array_arguments,
    patterns,
    read_frames,
    write_lines,
)
from tactile_node.helmholtz.features import compute_features


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('features', description=__doc__,
                                   help='print every quantity of the paper, a JSON line a frame')
    parser.set_defaults(run=run)
    add_array_arguments(parser)
    parser.add_argument('--largest-contact', action='store_true',
                        help='describe the largest 8-connected contact only, as the processor node does; '
                             'without it all active taxels of a frame are one pattern')
    parser.epilog = ('Prints {"frame": k, "N": ..., "P05": ..., "lambda5": ..., ..., "rotated": {name: '
                     '{"min", "max", "dif", "min_angle", "max_angle"}}}; null is undefined, '
                     'angles are in degrees.')


def run(args: argparse.Namespace) -> int:
    frames = read_frames(args.frames)
    found = patterns(frames, args, largest=args.largest_contact)
    write_lines(({'frame': k, **compute_features(pattern.mask).as_json()} for k, pattern in enumerate(found)), args)
    return 0
