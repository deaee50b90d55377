"""The arguments that `features` and `classify` share. They import no scipy: help and completion must be fast."""

import argparse

from tactile_node.cli.frame_png import DEFAULT_GREYS
from tactile_node.cli.records import add_output_arguments
from tactile_node.contact.press import PRESS_FRACTION, RELEASE_FRACTION
from tactile_node.press_levels import PRESS_BY_UNIT

FORMATS = ('.npy: (K, rows, cols) or (rows, cols), bool, integer or float. .npz: as `tactile replay` writes it, with '
           'stamps, pitch and unit; or of one array. .csv: a line a row of taxels, an empty line between frames, an '
           'empty cell has no valid value. .png: a grey pixel a taxel, top line first. NaN, infinite, transparent: no '
           'valid value')


def add_array_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the input, the output and the thresholds."""
    parser.add_argument('frames', nargs='*', default=['-'], metavar='FILE',
                        help=f'{FORMATS}. "-" or nothing: standard input. Each file is of one pad, its frames in the '
                             'order of time')
    add_output_arguments(parser)
    parser.add_argument('--unit', choices=list(PRESS_BY_UNIT),
                        help='of the values (1: on/off); an .npz has its own. Without a unit, pressed is relative to '
                             'the noise alone')
    parser.add_argument('--black', type=float, default=DEFAULT_GREYS.black, metavar='VALUE',
                        help='of a black pixel of a .png, default %(default)g')
    parser.add_argument('--white', type=float, default=DEFAULT_GREYS.white, metavar='VALUE',
                        help='of a white pixel, default %(default)g: fractions of full scale, bright is pressed. '
                             '--black 1 --white 0 for dark contacts on white; with --unit give both in that unit')
    numeric = parser.add_argument_group(
        'pressed taxels of integer and float values (a bool array is itself the pressed taxels)',
        'Pressed is what stands out of the noise of the taxels at rest (a quarter of them must rest), up to where it '
        'reads half of its contact. A file of 0 and one other value is on/off. Whole numbers less than 3 above the '
        'rest are noise. Frames of a file follow each other in time: what stays on after a contact is left over, so '
        'give independent images a file each. With --full-scale, a taxel is pressed from a fixed value on:')
    numeric.add_argument('--full-scale', type=float, metavar='VALUE', help='in the unit of the values')
    numeric.add_argument('--press', type=float, metavar='FRACTION',
                         help=f'of the full scale from which on a taxel is pressed, default {PRESS_FRACTION}')
    numeric.add_argument('--release', type=float, metavar='FRACTION',
                         help=f'of the full scale below which it is released, default {RELEASE_FRACTION} (or --press '
                              'where that is lower)')
