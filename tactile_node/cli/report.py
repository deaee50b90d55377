"""`tactile report` writes an HTML page about a recording, for a support ticket."""

import argparse
from collections.abc import Callable
from pathlib import Path

from tactile_node.cli.options import (
    add_any_device_option,
    add_model_option,
    add_output_option,
    add_pads_option,
    add_skin_options,
    add_window_options,
    bit_rate,
    eds_of,
    pads_of,
    recogniser_of,
    window_of,
)
from tactile_node.cli.progress import count_progress
from tactile_node.interruption import interruption
from tactile_node.logs.topic_bag import holds_taxels
from tactile_node.output_file import check_writable, output_file
from tactile_node.viewing.findings import findings
from tactile_node.viewing.recordings import BagRecording, LogRecording
from tactile_node.viewing.report_page import page_of
from tactile_node.viewing.reported_file import files_in
from tactile_node.viewing.reporter import BagReporter, LogReporter


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('log', metavar='LOG|BAG', help='CAN log as for `tactile replay`, or a ROS 2 bag with '
                        '<pad>/taxels: .mcap, .db3 or its folder. For a rotated series, name its first file')
    add_output_option(parser, metavar='FILE', default='report.html', help='default: %(default)s')
    add_skin_options(parser)
    add_pads_option(parser)
    parser.add_argument('--channel', default='', help='name of the bus to report on if the log contains several '
                        '(can0); for a bag, the topic')
    parser.add_argument('--bitrate', type=bit_rate, help='bit rate of the bus [bit/s], with which the page shows the '
                        'bus load as a percentage. No log contains the bit rate')
    add_any_device_option(parser)
    add_window_options(parser)
    add_model_option(parser)
    parser.epilog = ('The options for layouts, node-IDs, names, EDS, channel and bit rate apply to CAN frames; the '
                     'taxel arrays in a bag need none of them. The command prints the path of the page and the '
                     'problems that it found. The exit code is 0 if the page was written, even if it lists problems.')


def run(args: argparse.Namespace) -> int:
    check_writable(args.output, files_in(args.log), force=args.force)
    with interruption() as stop_requested, output_file(args.output) as stream, \
            count_progress(Path(args.log).name, ' frames') as bar:
        report = _reporter(args, bar.update).report(stop_requested)
        stream.write(page_of(report).encode())
    problems = [found.sentence for found in findings(report) if found.finding.is_problem]
    print(f'{args.output}: {_counted(len(report.pads), "pad")}, '
          f'{_counted(sum(len(pad.touches) for pad in report.pads), "touch", "touches")}, '
          f'{_counted(len(problems), "problem")}', *problems, sep='\n  ')
    return 0


def _counted(number: int, noun: str, plural: str = '') -> str:
    return f'{number} {noun if number == 1 else plural or noun + "s"}'


def _reporter(args: argparse.Namespace, on_message: Callable[[], object]) -> BagReporter | LogReporter:
    if holds_taxels(args.log):
        return BagReporter(BagRecording(args.log, window=window_of(args)), recogniser=recogniser_of(args),
                           on_message=on_message)
    log = LogRecording(args.log, pads_of(args, args.pads), args.channel, args.any_device, window_of(args),
                       eds_of(args))
    return LogReporter(log, bit_rate=args.bitrate, recogniser=recogniser_of(args), on_message=on_message)
