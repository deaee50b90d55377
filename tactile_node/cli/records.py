"""Results of frames as JSON lines or CSV, to standard output or a file."""

import argparse
import csv
import io
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence

from tactile_node.cli.options import add_output_option
from tactile_node.output_file import check_writable, output_file

Record = dict
JSON, CSV = 'json', 'csv'
KNOWN = 'file', 'frame', 'pad', 'stamp', 'sequence'  #: columns before those of the results


def add_output_arguments(parser: argparse.ArgumentParser) -> None:
    add_output_option(parser, metavar='FILE', help='write there instead of to standard output')
    parser.add_argument('--format', choices=(JSON, CSV), default=JSON,
                        help='json: an object a line; csv: a header, names within names joined by a dot, empty is '
                             'null; default %(default)s')


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


def flattened(record: Record, above: str = '') -> Record:
    """Return the record without levels.

    >>> flattened({'x': 1, 'sd': {'x': 0.1}})
    {'x': 1, 'sd.x': 0.1}
    """
    flat: Record = {}
    for name, value in record.items():
        flat |= flattened(value, f'{above}{name}.') if isinstance(value, dict) else {above + name: value}
    return flat


def _json_lines(records: Iterable[Record]) -> Iterator[str]:
    return (json.dumps(record, allow_nan=False) + '\n' for record in records)


def _csv_lines(records: Iterable[Record], columns: Sequence[str]) -> Iterator[str]:
    """A record with a name that is no column is an error of ours: it must not lose it."""
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, columns, lineterminator='\n')
    writer.writeheader()
    for record in records:
        writer.writerow(flattened(record))
        yield _taken(buffer)
    yield _taken(buffer)


def _taken(buffer: io.StringIO) -> str:
    text = buffer.getvalue()
    buffer.seek(0)
    buffer.truncate()
    return text
