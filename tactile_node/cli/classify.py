"""`tactile classify`: the shape of the largest contact, with the probability of every class."""

import argparse
import math

import numpy as np

from tactile_node.calibration.response import SkinResponse, load_response
from tactile_node.cli.arrays import (
    add_array_arguments,
    patterns,
    read_frames,
    write_lines,
)
from tactile_node.contact.pattern import ContactPattern
from tactile_node.library.contacts import fit_shape
from tactile_node.pose.fit import ShapeFit
from tactile_node.pose.pitch import check_pitch
from tactile_node.shape.methods import DEFAULT, FILES, LEARNED, METHODS, VOLF, make_recogniser
from tactile_node.shape.patch import join_pieces
from tactile_node.shape.recognition import Recognition


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('classify', description=__doc__,
                                   help='print the recognised shape, a JSON line a frame')
    parser.set_defaults(run=run)
    add_array_arguments(parser)
    parser.add_argument('--method', choices=list(METHODS), default=DEFAULT,
                        help='learned: network on pattern and pressures; volf: the paper; default %(default)s')
    parser.add_argument('--model', '--weights', dest='weights', default='', metavar='FILE',
                        help=f'of --method learned, such as one of `tactile teach`, default config/{FILES[LEARNED]}')
    parser.add_argument('--curves', default='', metavar='FILE',
                        help=f'of --method volf, default config/{FILES[VOLF]}')
    parser.add_argument('--pitch', type=float, metavar='METRES',
                        help='distance of neighbouring taxels: fit pose and size of what is recognised')
    parser.add_argument('--response', default='', metavar='FILE',
                        help="the skin's response, as written by `tactile calibrate`: readings become pressures by its "
                             'curve, fits know the depth of the taxels')
    parser.epilog = ('Prints {"frame": k, "shape": ..., "confidence": ..., "probabilities": {name: ...}, '
                     '"N": ..., "contacts": ...}: N taxels in the largest of so many contacts. An unknown shape has '
                     'a "reason": not_seen (too many NaN), unfamiliar or too_small. With --pitch, one of the five '
                     'shapes has "x", "y", "angle" of its centre and its x axis in the frame of the pad (origin at '
                     'taxel (0, 0), x along columns, y along rows; metres, radians), "dimensions" (metres) and "sd", '
                     'one standard deviation of each of them by name; the angle of a circle is null.')


def run(args: argparse.Namespace) -> int:
    if args.pitch is not None:
        check_pitch(args.pitch)
    recogniser = make_recogniser(args.method, {LEARNED: args.weights, VOLF: args.curves}[args.method])
    response = load_response(args.response) if args.response else None
    frames = read_frames(args.frames)
    if response is not None and frames.dtype != bool:
        frames = response.curve(frames)

    def records():
        for k, pattern in enumerate(patterns(frames, args, largest=True)):
            recognition = recogniser.recognise(pattern)
            yield {'frame': k, **recognition.as_json(),
                   'N': int(pattern.mask.sum()), 'contacts': pattern.contacts,
                   **(_fitted(pattern, recognition, args.pitch, response) if args.pitch else {})}

    write_lines(records(), args)
    return 0


def _fitted(pattern: ContactPattern, recognition: Recognition, pitch: float, response: SkinResponse | None) -> dict:
    """Pose and size of a recognised shape with their standard deviations; nothing for another answer."""
    contact = join_pieces(pattern) if recognition.joined else pattern
    fit = fit_shape(contact, recognition.shape, pitch, response) if contact.mask.any() else None
    return _as_json(fit) if fit else {}


def _as_json(fit: ShapeFit) -> dict:
    """Numbers that are not known, as the angle of a circle, are None."""
    found = dict(zip(fit.parameter_names, fit.parameters))
    deviations = dict(zip(fit.parameter_names, np.sqrt(np.diag(fit.covariance))))
    names = 'x', 'y', 'angle'
    return {**{name: _number(found.get(name)) for name in names},
            'dimensions': {name: _number(found[name]) for name in fit.dimension_names},
            'sd': {name: _number(deviations.get(name)) for name in (*names, *fit.dimension_names)}}


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
