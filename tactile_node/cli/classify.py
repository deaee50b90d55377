"""`tactile classify`: the shape of the largest contact, with the probability of every class."""

import argparse

from tactile_node.cli.arrays import (
    add_array_arguments,
    patterns,
    read_frames,
    write_lines,
)
from tactile_node.config import config_path
from tactile_node.helmholtz.features import compute_features
from tactile_node.shape.volf import GROUPS, VolfClassifier


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('classify', description=__doc__,
                                   help='print the recognised shape, a JSON line a frame')
    parser.set_defaults(run=run)
    add_array_arguments(parser)
    parser.add_argument('--curves', default='volf_curves.yaml', metavar='FILE',
                        help="the classifier's curves, default config/%(default)s")
    parser.epilog = ('Prints {"frame": k, "shape": ..., "confidence": ..., "probabilities": {name: ...}, '
                     '"N": ..., "contacts": ...}: N taxels in the largest of so many contacts.')


def run(args: argparse.Namespace) -> int:
    classifier = VolfClassifier.from_file(config_path(args.curves))
    frames = read_frames(args.frames)

    def records():
        for k, pattern in enumerate(patterns(frames, args, largest=True)):
            recognition = classifier.recognise(compute_features(pattern.mask, GROUPS))
            yield {'frame': k, **recognition.as_json(),
                   'N': int(pattern.mask.sum()), 'contacts': pattern.contacts}

    write_lines(records(), args.output)
    return 0
