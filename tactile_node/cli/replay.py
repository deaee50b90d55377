"""`tactile replay` plays a CAN log without ROS, writes taxel frames to a file and accounts for every CAN frame.
"""

import argparse
import io
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO

import numpy as np

from tactile_node.cli.frame_file import write_archive
from tactile_node.cli.options import (
    add_log_options,
    add_number,
    add_output_option,
    add_pads_option,
    add_window_options,
    pads_of,
    window_of,
)
from tactile_node.cli.played_log import play_log
from tactile_node.errors import ConfigurationError
from tactile_node.output_file import check_writable, output_file
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.pads import PadSettings
from tactile_node.sources.log_source import UNREAD_EXIT, summary
from tactile_node.taxel_frame import TaxelFrame


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('log', help='CAN log: .log (candump), .log.gz, .asc, .blf or .trc, or a ROS 2 bag of '
                        'can_msgs/msg/Frame: .mcap, .db3 or its folder. For a rotated series, name its first file')
    add_log_options(parser)
    add_pads_option(parser)
    add_number(parser, '--pace', limits={'remedy': '1 is the recorded pace, 0 as fast as possible.'}, default=0.0,
               help='1: recorded pace, 2: twice as fast, 0: as fast as possible (default: %(default)s)')
    add_window_options(parser)
    add_output_option(parser, metavar='FILE', help='file for the taxel frames. .npz: values (K, rows, cols), NaN = '
                        'invalid, with stamps, sequence, status, pad, pitch and unit; .npy: only the values. "-" '
                        'writes .npy to standard output, for one pad only. With several pads, each pad gets its own '
                        'file, with the name of the pad at the end (FILE_pad32)')
    parser.epilog = (f'The exit code is {UNREAD_EXIT} if a part of the log could not be read; the output then holds '
                     'the rest.')


def run(args: argparse.Namespace) -> int:
    """Play the log to its end.

    Returns
    -------
    int
        1 if a pad has no usable TPDO in the log, other nodes send a pad's COB-IDs, or the user interrupted the replay.
        Otherwise UNREAD_EXIT if part of the log could not be read, else 0.
    """
    pads = pads_of(args, args.pads)
    paths = _outputs(args.output, pads)
    for path in filter(None, paths.values()):
        check_writable(path, [args.log], force=args.force)
    with ExitStack() as stack:  # the file is opened before the log is played, to report an unwritable file early
        outputs = {name: stack.enter_context(output_file(path, [args.log]) if path else _standard_output())
                   for name, path in paths.items()}
        played = play_log(args.log, pads, pace=args.pace or None, channel=args.channel, any_device=args.any_device,
                          window=window_of(args), keep=bool(outputs))
        for name, stream in outputs.items():
            stream.write(_as_file(played.frames[name], name, pads[0].layout, is_archive=_is_archive(args.output)))
    facts = played.source.facts()
    print(summary(facts), file=sys.stderr if args.output == '-' else sys.stdout)
    for error in played.unused:
        print(error, file=sys.stderr)
    if not played.has_ended or played.unused or played.source.heard.strangers():
        return 1
    return UNREAD_EXIT if facts.unread_log_lines else 0


def _as_file(frames: list[TaxelFrame], pad: str, layout: SkinLayout, *, is_archive: bool) -> bytes:
    """Return the content of the output file, built in memory because NumPy needs to seek and a pipe cannot seek."""
    stream, shape = io.BytesIO(), (layout.rows, layout.cols)
    if is_archive:
        write_archive(stream, frames, shape, pad=pad, pitch=layout.pitch, unit=layout.value.unit)
    else:
        np.save(stream, np.array([frame.values for frame in frames], np.float32).reshape(-1, *shape))
    return stream.getvalue()


def _is_archive(output: str) -> bool:
    """Return True if ``output`` is an .npz file. Raises ConfigurationError for a suffix other than .npz or .npy."""
    suffix = Path(output).suffix.lower()
    if suffix not in ('', '.npy', '.npz'):
        raise ConfigurationError(f'--output {output}', expected='an .npz file (with stamps) or an .npy file',
                                 got=suffix, remedy='Name another file.')
    return suffix == '.npz'


def _outputs(output: str | None, pads: tuple[PadSettings, ...]) -> dict[str, Path | None]:
    """Return the output files by pad name, with None for standard output."""
    if output is None:
        return {}
    if output == '-':
        if len(pads) > 1:
            raise ConfigurationError('--output -', expected='one pad', got=f'{len(pads)} pads',
                                     remedy='Name a file, because each pad gets its own file.')
        return {pads[0].name: None}
    _is_archive(output)
    path = Path(output)
    if len(pads) == 1:
        return {pads[0].name: path}
    return {pad.name: path.with_name(f'{path.stem}_{pad.name.replace("/", "_")}{path.suffix}') for pad in pads}


def _standard_output() -> BinaryIO:
    return open(sys.stdout.fileno(), 'wb', closefd=False)
