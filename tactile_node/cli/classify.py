"""`tactile classify`: the shape of the largest contact, with the probability of every class."""

import argparse

from tactile_node.cli.options import add_number
from tactile_node.cli.records import add_array_arguments
from tactile_node.errors import ConfigurationError
from tactile_node.shape.recognition import DEFAULT_METHOD, LEARNED, METHOD_FILES, VOLF


def add_options(parser: argparse.ArgumentParser) -> None:
    add_array_arguments(parser)
    parser.add_argument('--method', choices=list(METHOD_FILES), default=DEFAULT_METHOD,
                        help='learned: network on pattern and pressures; volf: the paper; default %(default)s')
    parser.add_argument('--model', '--weights', dest='weights', default='', metavar='FILE',
                        help='of --method learned, such as one of `tactile teach` or `tactile assess`, '
                        f'default config/{METHOD_FILES[LEARNED]}')
    parser.add_argument('--curves', default='', metavar='FILE',
                        help=f'of --method volf, default config/{METHOD_FILES[VOLF]}')
    parser.add_argument('--pitch', type=float, metavar='METRES',
                        help='distance of neighbouring taxels: fit pose and size of what is recognised; an .npz has '
                             'its own')
    parser.add_argument('--response', default='', metavar='FILE',
                        help="the skin's response, as written by `tactile calibrate`: readings become pressures by its "
                             'curve, fits know the depth of the taxels')
    parser.add_argument('--fuse', action='store_true',
                        help='one belief over the frames of a contact, as the classifier node has it; needs the stamps '
                             'of an .npz, or --period')
    add_number(parser, '--period', limits={'above': 0, 'unit': 's'}, metavar='SECONDS',
               help='between two frames of a file without stamps')
    parser.epilog = ('Prints {"file": ..., "frame": k, "shape": ..., "confidence": ..., "probabilities": {name: ...}, '
                     '"N": ..., "contacts": ...}: N taxels in the largest of so many contacts. An unknown shape has '
                     'a "reason": not_seen (too many NaN), unfamiliar, too_small, cut_by_edge, hollow, several_parts '
                     'or covers_pad. A name that the taxels do not support has a "doubt": too_small, unfamiliar (its '
                     'outline fits badly) or unstable (another pressure outlines another shape). With a pitch, one of '
                     'the five shapes has "x", "y", "angle" of its centre and its x axis in the frame of the pad '
                     '(origin at taxel (0, 0), x along columns, y along rows; metres, radians), "dimensions" (metres) '
                     'and "sd", '
                     'one standard deviation of each of them by name; the angle of a circle is null. "is_bound": '
                     'dimensions of which the edge of the pad or hidden taxels show a part only. Every contact, '
                     'unknown too, has a "box", the least rectangle around it, with the same of its "long" and "short" '
                     'side; "hollow": a ring or a frame. Of an .npz also '
                     '"pad", "stamp" [s] and "sequence". With --fuse "held" [s] and "fused_frames": since when '
                     'the shape is the same.')


def run(args: argparse.Namespace) -> int:
    for option, file, method in (('--model', args.weights, LEARNED), ('--curves', args.curves, VOLF)):
        if file and args.method != method:
            raise ConfigurationError(option, expected=f'--method {method}, which reads it', got=args.method,
                                     remedy=f'Leave {option} out, or choose its method.')
    from tactile_node.cli.classified import write_shapes  # scipy: only where it is needed
    write_shapes(args)
    return 0
