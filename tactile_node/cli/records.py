"""Results of frames as JSON lines or CSV, to standard output or a file."""

import argparse
import csv
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from tactile_node.cli.frame_png import DEFAULT_GREYS
from tactile_node.cli.options import add_output_option
from tactile_node.contact.press import PRESS_FRACTION, RELEASE_FRACTION
from tactile_node.output_file import check_writable, output_file
from tactile_node.taxel_frame import PRESS_BY_UNIT

Record = dict
JSON, CSV = 'json', 'csv'
KNOWN_COLUMNS = 'file', 'frame', 'pad', 'stamp', 'sequence'  #: columns before those of the results


def prints(args: argparse.Namespace) -> bool:
    """Return whether results go to standard output."""
    return args.output is None or args.output == '-'


def write_records(records: Iterable[Record], columns: Callable[[], Sequence[str]], args: argparse.Namespace) -> None:
    """Write ``records`` as ``args`` ask for: strict JSON, or CSV of ``columns``; never over ``args.frames``."""
    lines = _json_lines(records) if args.format == JSON else _csv_lines(records, columns())
    if prints(args):
        for line in lines:  # one by one, for who reads a pipe
            sys.stdout.write(line)
        return
    inputs = [path for path in args.frames if path != '-']
    check_writable(args.output, inputs, force=args.force)
    with output_file(args.output, inputs) as stream:
        stream.writelines(map(str.encode, lines))


def flatten(record: Record, above: str = '') -> Record:
    """Return the record without levels.

    >>> flatten({'x': 1, 'sd': {'x': 0.1}})
    {'x': 1, 'sd.x': 0.1}
    """
    flat: Record = {}
    for name, value in record.items():
        flat |= flatten(value, f'{above}{name}.') if isinstance(value, dict) else {above + name: value}
    return flat


def _json_lines(records: Iterable[Record]) -> Iterator[str]:
    return (json.dumps(record, allow_nan=False) + '\n' for record in records)


def _csv_lines(records: Iterable[Record], columns: Sequence[str]) -> Iterator[str]:
    """A record with a name that is no column is an error of ours: it must not lose it."""
    writer: Any = csv.DictWriter(_Line(), columns, lineterminator='\n')  # it returns what its file's write returns
    header = writer.writeheader()
    for record in records:
        yield header + writer.writerow(flatten(record))
        header = ''
    yield header


class _Line:
    def write(self, text: str) -> str:
        return text


FORMATS_HELP = (
    '.npy: (K, rows, cols) or (rows, cols), bool, integer or float. .npz: as `tactile replay` writes it, with stamps, '
    'pitch and unit; or of one array. .csv: a line a row of taxels, an empty line between frames, an empty cell has no '
    'valid value. .png: a grey pixel a taxel, top line first. NaN, infinite, transparent: no valid value')


def add_array_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the input, the output and the thresholds."""
    parser.add_argument('frames', nargs='*', default=['-'], metavar='FILE',
                        help=f'{FORMATS_HELP}. "-" or nothing: standard input. Each file is of one pad, its frames in '
                             'the order of time')
    add_output_option(parser, metavar='FILE', help='write there instead of to standard output')
    parser.add_argument('--format', choices=(JSON, CSV), default=JSON,
                        help='json: an object a line; csv: a header, names within names joined by a dot, empty is '
                             'null; default %(default)s')
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
