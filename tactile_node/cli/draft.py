"""`tactile draft` drafts a skin layout from the TPDOs in an EDS, and marks the values that the EDS does not contain."""

import argparse

from tactile_node.bus.bus_settings import DEFAULT_NODE_ID
from tactile_node.cli.options import add_number, add_output_option
from tactile_node.output_file import check_writable, output_file
from tactile_node.skin.eds import load_eds
from tactile_node.skin.layout import MAX_SIDE
from tactile_node.skin.layout_draft import FILL_IN, GUESS, MAX_BITS, Known, draft


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('eds', help='EDS: a file, or a name in config/')
    for side in ('rows', 'cols'):
        add_number(parser, f'--{side}', int, limits={'least': 1, 'most': MAX_SIDE},
                   help=f'number of {side} of the pad (default: guessed)')
    add_number(parser, '--bits', int, limits={'least': 1, 'most': MAX_BITS}, help='bits per taxel, if a mapped object '
               'holds several taxels or a part of one (default: the most common width of the mapped objects)')
    add_output_option(parser, metavar='FILE', help='file to write (default: print the layout)')


def run(args: argparse.Namespace) -> int:
    """Print or write the layout."""
    if args.output:
        check_writable(args.output, [args.eds], force=args.force)
    text = draft(load_eds(args.eds, DEFAULT_NODE_ID), DEFAULT_NODE_ID, args.eds, Known(args.rows, args.cols, args.bits))
    if args.output:
        with output_file(args.output, inputs=[args.eds]) as stream:
            stream.write(text.encode())
        print(f'written to {args.output}. Replace the values marked {FILL_IN} and verify the values marked {GUESS}. '
              f'Then run: tactile check {args.output} {args.eds}')
    else:
        print(text, end='')
    return 0
