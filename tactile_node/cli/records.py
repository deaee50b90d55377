"""Write one result per frame as JSON lines, to standard output or to a file."""

import argparse
import json
import sys
from collections.abc import Iterable

from tactile_node.cli.frame_png import DEFAULT_GREYS
from tactile_node.cli.options import add_output_option
from tactile_node.contact.press import PRESS_FRACTION, RELEASE_FRACTION
from tactile_node.errors import ConfigurationError
from tactile_node.output_file import check_writable, output_file
from tactile_node.taxel_frame import PRESS_BY_UNIT

Record = dict


def write_records(records: Iterable[Record], args: argparse.Namespace) -> None:
    """Write records, one per frame, to the output selected by the options.

    ``args`` contains the output and the input files. Input files are never overwritten.
    """
    lines = (json.dumps(record, allow_nan=False) + '\n' for record in records)
    if args.output is None:
        for line in lines:  # one line at a time, so that a pipe receives each result immediately
            sys.stdout.write(line)
        return
    if args.output == '-':
        raise ConfigurationError('output', expected='the name of a file', got='-',
                                 remedy='Leave out the option to write to standard output.')
    check_writable(args.output, args.frames, force=args.force)
    with output_file(args.output, args.frames) as stream:
        stream.writelines(map(str.encode, lines))


FORMATS_HELP = (
    '.npy: array (K, rows, cols) or (rows, cols), bool, integer or float. .npz: the archive that `tactile replay` '
    'writes, with stamps, pitch and unit; or an archive with a single array. .csv: one line per row of taxels, an '
    'empty line between frames; an empty cell has no valid value. .png: one grey pixel per taxel, top line first. NaN, '
    'infinite values and transparent pixels mean: no valid value')


def add_array_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for the input, the output and the thresholds."""
    parser.add_argument('frames', nargs='+', metavar='FILE',
                        help=f'{FORMATS_HELP}. Each file holds the frames of one pad, in chronological order')
    add_output_option(parser, metavar='FILE', help='file to write (default: standard output)')
    parser.add_argument('--unit', choices=list(PRESS_BY_UNIT),
                        help='unit of the values (1: on/off). An .npz file has its own unit. Without a unit, the noise '
                             'alone decides which taxels are pressed')
    parser.add_argument('--black', type=float, default=DEFAULT_GREYS.black, metavar='VALUE',
                        help='value of a black pixel in a .png (default: %(default)g)')
    parser.add_argument('--white', type=float, default=DEFAULT_GREYS.white, metavar='VALUE',
                        help='value of a white pixel in a .png (default: %(default)g). The defaults give fractions of '
                             'full scale, and bright means pressed. For dark contacts on white, use --black 1 --white '
                             '0. With --unit, give both values in that unit')
    numeric = parser.add_argument_group(
        'pressed taxels of integer and float values (a bool array gives the pressed taxels directly)',
        'A taxel is pressed if its value stands out from the noise of the taxels at rest and reaches half of the level '
        'of its contact. At least a quarter of the taxels must be at rest. Whole numbers less than 3 above the rest '
        'count as noise. A file with 0 and only one other value is on/off. The frames of a file must follow each other '
        'in time, because a taxel that stays on after a contact is treated as left over. Put independent images into '
        'separate files. With --full-scale, a taxel is pressed from a fixed value on:')
    numeric.add_argument('--full-scale', type=float, metavar='VALUE',
                         help='largest value that a taxel can have, in the unit of the values')
    numeric.add_argument('--press', type=float, metavar='FRACTION',
                         help=f'fraction of full scale at which a taxel becomes pressed (default: {PRESS_FRACTION})')
    numeric.add_argument('--release', type=float, metavar='FRACTION',
                         help=f'fraction of full scale below which a taxel is released (default: {RELEASE_FRACTION}, '
                              'or --press if that is lower)')

