"""`tactile calibrate` determines the response of a skin by pressing a disc of known size onto the pad.

The response consists of the depth of the taxels and the curve that converts readings to pressure. Take a rigid cylinder
with a flat face, at least 10 pitches in diameter. Record the pad at rest. Then press the disc onto the pad at six or
more places, both lightly and firmly, and lift it between presses. The face must lie flat and stay within the pad.
"""

import argparse
import sys
from pathlib import Path

from tactile_node.cli.frame_file import TaxelFrames, read_frames
from tactile_node.cli.options import add_log_options, add_output_option, pads_of, single_pad_of
from tactile_node.cli.played_log import play_log
from tactile_node.cli.progress import count_progress
from tactile_node.conditioning.gain import load_gains
from tactile_node.errors import ConfigurationError, InputError
from tactile_node.learning.presses import PressFinder, subtract_zero
from tactile_node.learning.response import RESPONSE_SUFFIX, save_response
from tactile_node.learning.response_fit import Disc, FoundResponse, calibrate, check_disc
from tactile_node.learning.touches import Touches
from tactile_node.output_file import check_writable
from tactile_node.taxel_frame import ON_OFF_UNIT, TaxelStatus

SUSPICIOUS_ERROR = 0.06  #: relative error of the uncalibrated radius above which the given --radius may be wrong


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('recording', help='CAN log as for `tactile record`, or an .npz of `tactile replay`')
    parser.add_argument('--radius', type=float, required=True, metavar='METRES',
                        help='radius of the face that touches the pad [m]')
    parser.add_argument('--edge-radius', type=float, default=0.0, metavar='METRES',
                        help='radius of the rounded edge of that face [m] (default: 0, a sharp edge)')
    add_log_options(parser)
    parser.add_argument('--gains', default='', metavar='FILE', help='file with per-taxel gains, as in gain_files of '
                        'the driver')
    add_output_option(parser, metavar='FILE', help='file to write (default: beside the layout, with the suffix '
                      f'{RESPONSE_SUFFIX})')


def run(args: argparse.Namespace) -> int:
    known = Disc(args.radius, args.edge_radius)
    check_disc(known)
    output = _output(args)
    check_writable(output, [args.recording], force=args.force)
    readings = _readings(args)
    assert readings.status is not None and readings.pitch is not None and readings.unit is not None
    found = PressFinder(readings.unit).find(readings.values, readings.status == TaxelStatus.SATURATED)
    print(f'{sum(len(press.frames) for press in found.touches)} frames used, of {found}')
    with count_progress('fitting', ' fits') as bar:
        calibration = calibrate(found.touches, known, readings.pitch, readings.unit, progress=bar.update)
    save_response(output, calibration.response, _head(args), _found_from(known, found, calibration))
    print(_summary(calibration))
    if abs(calibration.before) > SUSPICIOUS_ERROR:
        print(f'tactile: without calibration the radius would be {100 * calibration.before:+.1f} % off, which is more '
              'than for most skins. A wrong --radius has the same effect: measure the face again.', file=sys.stderr)
    print(f'written to {output}. Pass the file to the driver (response_files) or to tactile classify (--response).')
    return 0


def _output(args: argparse.Namespace) -> str:
    if args.output:
        return str(args.output)
    if _is_archive(args):
        raise ConfigurationError('--output', expected='a file to write', got='none', remedy='Name one.')
    return str(Path(pads_of(args)[0].layout.source).with_suffix(RESPONSE_SUFFIX))


def _is_archive(args: argparse.Namespace) -> bool:
    return Path(args.recording).suffix == '.npz'


def _readings(args: argparse.Namespace) -> TaxelFrames:
    """Return the frames of one pad, with the zero subtracted and the gains applied."""
    found = _of_archive(args.recording) if _is_archive(args) else _of_log(args)
    values = subtract_zero(found.values)
    if args.gains:
        values = values * load_gains(args.gains, *values.shape[1:])
    return found._replace(values=values)


def _of_archive(path: str) -> TaxelFrames:
    found = read_frames(path)
    if found.pitch is None or found.unit is None or found.status is None:
        raise InputError(f'file {path!r}', expected='frames with pitch, unit and status', got='an array without them',
                         remedy='Give the CAN log, or the .npz that `tactile replay` makes from it.')
    if found.unit == ON_OFF_UNIT:
        raise _on_off(path)
    return found


def _of_log(args: argparse.Namespace) -> TaxelFrames:
    pad = single_pad_of(args, 'Calibrate each pad from its own presses.')
    layout = pad.layout
    if layout.value.unit == ON_OFF_UNIT:
        raise _on_off(layout.source)
    played = play_log(args.recording, (pad,), channel=args.channel, any_device=args.any_device, must_be_used=True)
    return TaxelFrames.of(played.frames[pad.name], (layout.rows, layout.cols), pad.name, layout.pitch,
                          layout.value.unit)


def _on_off(where: str) -> InputError:
    return InputError(where, expected='readings that increase with pressure', got='on/off taxels',
                      remedy='On/off taxels have no response to calibrate.')


def _summary(found: FoundResponse) -> str:
    layer = found.response.layer
    return (f'Radius of the disc: {100 * found.before:+.1f} % without the calibration, {100 * found.after:+.1f} % '
            f'with it ({100 * found.left_out:+.1f} % in presses left out).\n'
            f'Taxels lie {1000 * layer.depth:.2f} mm below the surface (standard deviation {layer.deviation:.0%}); '
            f'pressure grows as their reading to the power {found.exponent:.2f}.')


def _head(args: argparse.Namespace) -> str:
    return (f'Response of a tactile skin, by tactile calibrate {Path(args.recording).name}. All taxels share it.\n'
            'layer: depth of the taxels below the surface [m], standard deviation of its logarithm.\n'
            'curve: pressures for readings, straight lines between.')


def _found_from(known: Disc, found: Touches, calibration: FoundResponse) -> dict:
    errors = {'before': calibration.before, 'after': calibration.after, 'left_out': calibration.left_out}
    return {'disc': {'radius': known.radius, 'edge_radius': known.edge_radius}, 'presses': len(found.touches),
            'exponent': round(calibration.exponent, 3), 'bend': round(calibration.bend, 3),
            'radius_error': {name: round(error, 4) for name, error in errors.items()}}
