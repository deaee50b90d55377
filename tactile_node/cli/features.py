"""`tactile features`: every quantity of the paper, by the names of tactile_node.helmholtz.features."""

import argparse

from tactile_node.cli.records import add_array_arguments
from tactile_node.errors import InputError
from tactile_node.helmholtz.feature_groups import Group

#: as written on the command line, in the order of the help
NAMED_GROUPS = {name.lower(): group for name, group in Group.__members__.items()}


def add_options(parser: argparse.ArgumentParser) -> None:
    add_array_arguments(parser)
    parser.add_argument('--groups', type=groups, default=Group.ALL, metavar='GROUP,...',
                        help=f'compute only these, besides N, P05 and P09: {", ".join(NAMED_GROUPS)}. classifier: what '
                             "the paper's planes need; default all")
    parser.add_argument('--largest-contact', action='store_true',
                        help='describe the largest 8-connected contact only, as the processor node does; '
                             'without it all active taxels of a frame are one pattern')
    parser.epilog = ('Prints {"file": ..., "frame": k, "N": ..., "P05": ..., "lambda5": ..., ..., "rotated": {name: '
                     '{"min", "max", "dif", "min_angle", "max_angle"}}}; null is undefined, '
                     'angles are in degrees. Of an .npz also "pad", "stamp" [s] and "sequence".')


def groups(text: str) -> Group:
    """'gravity,rotated' -> Group.GRAVITY | Group.ROTATED."""
    chosen = Group.NONE
    for name in text.split(','):
        if name.strip() not in NAMED_GROUPS:
            raise InputError('--groups', expected=f'names out of {", ".join(NAMED_GROUPS)}, comma-separated',
                             got=repr(name), remedy='For example --groups gravity,rotated.')
        chosen |= NAMED_GROUPS[name.strip()]
    return chosen


def run(args: argparse.Namespace) -> int:
    from tactile_node.cli.frame_patterns import write_features  # scipy: only where it is needed
    write_features(args)
    return 0
