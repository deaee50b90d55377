"""`tactile classify`: the shape of the largest contact, with the probability of every class."""

import argparse

from tactile_node.cli.arrays import (
    add_array_arguments,
    patterns,
    read_frames,
    write_lines,
)
from tactile_node.shape.methods import DEFAULT, FILES, LEARNED, METHODS, VOLF, make_recogniser


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('classify', description=__doc__,
                                   help='print the recognised shape, a JSON line a frame')
    parser.set_defaults(run=run)
    add_array_arguments(parser)
    parser.add_argument('--method', choices=list(METHODS), default=DEFAULT,
                        help='learned: network on pattern and pressures; volf: the paper; default %(default)s')
    parser.add_argument('--weights', default='', metavar='FILE',
                        help=f'of --method learned, default config/{FILES[LEARNED]}')
    parser.add_argument('--curves', default='', metavar='FILE',
                        help=f'of --method volf, default config/{FILES[VOLF]}')
    parser.epilog = ('Prints {"frame": k, "shape": ..., "confidence": ..., "probabilities": {name: ...}, '
                     '"N": ..., "contacts": ...}: N taxels in the largest of so many contacts. An unknown shape has '
                     'a "reason": not_seen (too many NaN), unfamiliar or too_small.')


def run(args: argparse.Namespace) -> int:
    recogniser = make_recogniser(args.method, {LEARNED: args.weights, VOLF: args.curves}[args.method])
    frames = read_frames(args.frames)

    def records():
        for k, pattern in enumerate(patterns(frames, args, largest=True)):
            recognition = recogniser.recognise(pattern)
            yield {'frame': k, **recognition.as_json(),
                   'N': int(pattern.mask.sum()), 'contacts': pattern.contacts}

    write_lines(records(), args.output)
    return 0
