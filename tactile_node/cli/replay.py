"""`tactile replay` reads a recording without ROS, and writes its taxel frames to a file.

From a CAN log, the command assembles the taxel frames as the driver does, and accounts for every CAN frame. From a bag
of topics, the command takes the taxel frames that the driver has published.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import BinaryIO

from tactile_node.bus.bus_settings import DEFAULT_LAYOUT
from tactile_node.cli.bag_frames import read_bag
from tactile_node.cli.frame_file import TaxelFrames, write_archive
from tactile_node.cli.options import (
    add_log_options,
    add_output_option,
    add_pads_option,
    add_window_options,
    pads_of,
    window_of,
)
from tactile_node.cli.played_log import play_log
from tactile_node.errors import ConfigurationError
from tactile_node.logs.topic_bag import holds_can_frames, holds_taxels
from tactile_node.output_file import check_writable, output_file
from tactile_node.sources.log_source import UNREAD_EXIT, summary
from tactile_node.viewing.recordings import BagRecording


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('log', help='CAN log: .log (candump), .log.gz, .asc, .blf or .trc, or a ROS 2 bag of '
                        'can_msgs/msg/Frame: .mcap, .db3 or its folder. For a rotated series, name its first file. '
                        'Or a bag of the topics <pad>/taxels; the pads and their geometry are then those of the bag')
    add_log_options(parser)
    add_pads_option(parser)
    add_window_options(parser)
    add_output_option(parser, metavar='FILE', help='.npz file for the taxel frames: values (K, rows, cols), NaN = '
                        'invalid, with stamps, sequence, status, pad, pitch and unit. With several pads, each pad gets '
                        'its own file, with the name of the pad at the end (FILE_pad32)')
    parser.epilog = (f'The exit code is {UNREAD_EXIT} if a part of the log could not be read; the output then holds '
                     'the rest.')


def run(args: argparse.Namespace) -> int:
    """Read the recording to its end.

    Returns
    -------
    int
        For a log, 1 if a pad has no usable TPDO, other nodes send a pad's COB-IDs, or the user interrupted the replay.
        Otherwise UNREAD_EXIT if part of the recording could not be read, else 0.
    """
    return _convert_bag(args) if holds_taxels(args.log) and not holds_can_frames(args.log) else _play_log(args)


def _play_log(args: argparse.Namespace) -> int:
    pads = pads_of(args, args.pads)
    with _opened(args, [pad.name for pad in pads]) as outputs:
        played = play_log(args.log, pads, channel=args.channel, any_device=args.any_device,
                          window=window_of(args), keep=bool(outputs))
        for pad in pads if outputs else ():
            layout = pad.layout
            write_archive(outputs[pad.name], TaxelFrames.of(
                played.frames[pad.name], (layout.rows, layout.cols), pad.name, layout.pitch, layout.value.unit))
    facts = played.source.facts()
    print(summary(facts))
    for error in played.unused:
        print(error, file=sys.stderr)
    if further := played.source.heard.further_pads():
        node_ids = [node_id for pad in pads for node_id in pad.node_ids]
        print(f'{args.log}: node {", ".join(map(str, further))} also sends all TPDOs of this layout. If it is a '
              f'pad, give --node-id {",".join(map(str, node_ids + further))}.', file=sys.stderr)
    if not played.has_ended or played.unused or played.source.heard.strangers():
        return 1
    return UNREAD_EXIT if facts.unread_log_lines else 0


def _convert_bag(args: argparse.Namespace) -> int:
    ignored = {'--node-id': args.node_id, '--layout': args.layout != DEFAULT_LAYOUT, '--channel': args.channel,
               '--any-device': args.any_device}
    if given := [option for option, is_given in ignored.items() if is_given]:
        raise ConfigurationError('tactile replay', got=', '.join(given), remedy='Leave them out.',
                                 expected='for a bag of topics only --pads, --start, --duration, --output and --force')
    recording = BagRecording(args.log, args.pads, window_of(args))
    with _opened(args, recording.pads) as outputs:
        pads = read_bag(recording)
        for name, stream in outputs.items():
            shape, pitch, unit, frames = pads[name]
            write_archive(stream, TaxelFrames.of(frames, shape, name, pitch, unit))
    for name, found in pads.items():
        print(f'{name}: {found.summary}')
    return UNREAD_EXIT if recording.unread else 0


@contextmanager
def _opened(args: argparse.Namespace, names: Sequence[str]) -> Iterator[dict[str, BinaryIO]]:
    """Open the output of each pad. Files are opened before the recording is read, to report unwritable files early."""
    paths = _outputs(args.output, names)
    for path in paths.values():
        check_writable(path, [args.log], force=args.force)
    with ExitStack() as stack:
        yield {name: stack.enter_context(output_file(path, [args.log])) for name, path in paths.items()}


def _outputs(output: str | None, names: Sequence[str]) -> dict[str, Path]:
    """Return the output files by pad name. Raises ConfigurationError for a suffix other than .npz."""
    if output is None:
        return {}
    path = Path(output)
    if path.suffix.lower() != '.npz':
        raise ConfigurationError(f'--output {output}', expected='an .npz file', got=path.suffix or 'no suffix',
                                 remedy='Name another file.')
    if len(names) == 1:
        return {names[0]: path}
    return {name: path.with_name(f'{path.stem}_{name.replace("/", "_")}{path.suffix}') for name in names}
