"""`tactile classify` recognises the shape of the largest contact in each frame, with the probability of each class."""

import argparse

from tactile_node.cli.options import add_number
from tactile_node.cli.records import add_array_arguments
from tactile_node.errors import ConfigurationError
from tactile_node.shape.recognition import DEFAULT_METHOD, LEARNED, METHOD_FILES, VOLF


def add_options(parser: argparse.ArgumentParser) -> None:
    add_array_arguments(parser)
    parser.add_argument('--method', choices=list(METHOD_FILES), default=DEFAULT_METHOD,
                        help='learned: network on pattern and pressures; volf: method of the paper, on the pattern '
                             'alone (default: %(default)s)')
    parser.add_argument('--model', default='', metavar='FILE',
                        help='model of --method learned, for example a file of `tactile teach` or `tactile assess` '
                        f'(default: config/{METHOD_FILES[LEARNED]})')
    parser.add_argument('--curves', default='', metavar='FILE',
                        help=f'curves of --method volf (default: config/{METHOD_FILES[VOLF]})')
    parser.add_argument('--pitch', type=float, metavar='METRES',
                        help='distance between neighbouring taxels; with a pitch, the command fits pose and size of a '
                             'recognised shape (default: the pitch in an .npz)')
    parser.add_argument('--response', default='', metavar='FILE',
                        help='file of `tactile calibrate` with the response of the skin: the curve converts readings '
                             'to pressures, and the fits use the depth of the taxels')
    parser.add_argument('--fuse', action='store_true',
                        help='combine the frames of a contact, as the classifier node does; needs the stamps of an '
                             '.npz, or --period')
    add_number(parser, '--period', limits={'above': 0, 'unit': 's'}, metavar='SECONDS',
               help='time between two frames of a file without stamps')
    parser.epilog = (
        'The command prints for each frame {"file": ..., "frame": k, "shape": ..., "confidence": ..., "probabilities": '
        '{name: ...}, "N": ..., "contacts": ...}. "contacts" is the number of contacts, and "N" the number of taxels '
        'of the largest contact. An unknown shape has a "reason": not_seen (too many taxels are NaN), unfamiliar, '
        'too_small, cut_by_edge, hollow, several_parts or covers_pad. A name that the taxels do not support has a '
        '"doubt": too_small, unfamiliar (the outline of this shape fits badly) or unstable (at another pressure, the '
        'outline is that of another shape). With a pitch, each of the five shapes has "x" and "y" of its centre, '
        '"angle" of its x axis, "dimensions", and "sd" with the standard deviation of each of these by name. Lengths '
        'are in metres and angles in radians, in the pad frame: origin at taxel (0, 0), x along columns, y along rows. '
        'The angle of a circle is null. "is_bound" is true for a dimension of which only a part is visible, because '
        'the contact reaches the edge of the pad or hidden taxels. With a pitch, every contact, also an unknown one, '
        'has a "box", the smallest rectangle around the contact. The box has the same fields; its sides are "long" and '
        '"short". "hollow" is true for a ring or a frame. For an .npz, the command also prints "pad", "stamp" [s] and '
        '"sequence". With --fuse, "held" is the time for which the shape has been the same [s], and "fused_frames" is '
        'the number of these frames.')


def run(args: argparse.Namespace) -> int:
    for option, file, method in (('--model', args.model, LEARNED), ('--curves', args.curves, VOLF)):
        if file and args.method != method:
            raise ConfigurationError(option, expected=f'--method {method}, which reads this file', got=args.method,
                                     remedy=f'Omit {option}, or give --method {method}.')
    from tactile_node.cli.classified import write_shapes  # scipy would slow down shell completion
    write_shapes(args)
    return 0
