"""`tactile features` computes the quantities defined in the paper, named as in tactile_node.helmholtz.features."""

import argparse

from tactile_node.cli.records import add_array_arguments
from tactile_node.errors import InputError
from tactile_node.helmholtz.feature_groups import Group

#: group names as on the command line, in the order of the help text
NAMED_GROUPS = {name.lower(): group for name, group in Group.__members__.items()}


def add_options(parser: argparse.ArgumentParser) -> None:
    add_array_arguments(parser)
    parser.add_argument('--groups', type=groups, default=Group.ALL, metavar='GROUP,...',
                        help=f'compute only these groups, besides N, P05 and P09: {", ".join(NAMED_GROUPS)}. '
                             "classifier: the quantities that the paper's planes need (default: all)")
    parser.add_argument('--largest-contact', action='store_true',
                        help='describe only the largest 8-connected contact, as the processor node does; '
                             'without this option, all active taxels of a frame form one pattern')
    parser.epilog = ('Prints {"file": ..., "frame": k, "N": ..., "P05": ..., "lambda5": ..., ..., "rotated": {name: '
                     '{"min", "max", "dif", "min_angle", "max_angle"}}}. null means undefined; '
                     'angles are in degrees. For an .npz, also prints "pad", "stamp" [s] and "sequence".')


def groups(text: str) -> Group:
    """Convert 'gravity,rotated' to Group.GRAVITY | Group.ROTATED. Raises InputError for an unknown name."""
    chosen = Group.NONE
    for name in text.split(','):
        if name.strip() not in NAMED_GROUPS:
            raise InputError('--groups', expected=f'comma-separated names from {", ".join(NAMED_GROUPS)}',
                             got=repr(name), remedy='Give, for example, --groups gravity,rotated.')
        chosen |= NAMED_GROUPS[name.strip()]
    return chosen


def run(args: argparse.Namespace) -> int:
    from tactile_node.cli.frame_patterns import write_features  # scipy would slow down shell completion
    write_features(args)
    return 0
