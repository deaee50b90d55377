"""What `features` and `classify` share: reading frames from .npy, writing JSON lines."""

import argparse
import io
import json
import sys
from collections.abc import Iterable, Iterator
from zipfile import BadZipFile

import numpy as np

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.press import PRESS_FRACTION, RELEASE_FRACTION, PressThresholds
from tactile_node.errors import InputError
from tactile_node.output_file import output_file


def add_array_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the input, the output and the thresholds."""
    parser.add_argument('frames', nargs='?', default='-', metavar='FRAMES.npy',
                        help='array (K, rows, cols) or (rows, cols), bool, integer or float; NaN and '
                             'infinite are taxels without a valid value; "-" or nothing: standard input')
    parser.add_argument('-o', '--output', metavar='FILE', help='write there instead of to standard output')
    numeric = parser.add_argument_group(
        'pressed taxels of integer and float arrays (a bool array is itself the pressed taxels)',
        'Pressed is what stands out of the noise of the taxels at rest (a quarter of them must rest), up to where it '
        'reads half of its contact. An array of 0 and one other value is on/off. Whole numbers less than 3 above the '
        'rest are noise. Frames of a file follow each other in time: what stays on after a contact is left over, so '
        'give independent images a file each. With --full-scale, a taxel is pressed from a fixed value on:')
    numeric.add_argument('--full-scale', type=float, metavar='VALUE', help='in the unit of the values')
    numeric.add_argument('--press', type=float, metavar='FRACTION',
                         help=f'of the full scale from which on a taxel is pressed, default {PRESS_FRACTION}')
    numeric.add_argument('--release', type=float, metavar='FRACTION',
                         help=f'of the full scale below which it is released, default {RELEASE_FRACTION} (or --press '
                              'where that is lower)')


def read_frames(path: str) -> np.ndarray:
    """Read an array as (K, rows, cols), bool or float (values that are not finite as NaN).

    Raises InputError where there is no such array.
    """
    frames = _load(path)
    if frames.dtype.kind not in 'biuf':
        raise _unusable(path, f'numbers of type {frames.dtype}')
    if frames.ndim == 2:
        frames = frames[np.newaxis]
    if frames.ndim != 3 or 0 in frames.shape[1:]:
        raise _unusable(path, f'shape {frames.shape}')
    if frames.dtype == bool:
        return frames
    frames = frames.astype(float)
    frames[~np.isfinite(frames)] = np.nan
    return frames


def patterns(frames: np.ndarray, args: argparse.Namespace, *, largest: bool) -> Iterator[ContactPattern]:
    """Yield the contact pattern of each frame; of a bool frame, all active taxels unless ``largest``."""
    extractor = PatternExtractor(_thresholds(args), largest=largest)
    yield from map(extractor.extract, frames)


def write_lines(records: Iterable[dict], args: argparse.Namespace) -> None:
    """Write each record as one line of strict JSON to the output that ``args`` name, which is not their input."""
    lines = (json.dumps(record, allow_nan=False) + '\n' for record in records)
    if args.output is None or args.output == '-':
        for line in lines:  # one by one, for who reads a pipe
            sys.stdout.write(line)
        return
    with output_file(args.output, inputs=() if args.frames == '-' else (args.frames,)) as stream:
        stream.writelines(map(str.encode, lines))


def _load(path: str) -> np.ndarray:
    try:
        # Standard input cannot be rewound, which numpy wants.
        source = io.BytesIO(sys.stdin.buffer.read()) if path == '-' else path
        loaded = np.load(source, allow_pickle=False)
    except OSError as error:
        raise _unusable(path, error.strerror or str(error)) from None
    except EOFError:
        raise _unusable(path, 'nothing') from None
    except MemoryError:
        raise _unusable(path, 'more than fits into memory') from None
    except (ValueError, BadZipFile) as error:
        # numpy takes whatever is not its own format for a pickle, which we never load.
        got = 'another format, or Python objects' if 'pickle' in str(error) else ' '.join(str(error).split())
        raise _unusable(path, got) from None
    if not isinstance(loaded, np.ndarray):
        raise _unusable(path, 'an archive of several arrays (.npz)')
    return loaded


def _thresholds(args: argparse.Namespace) -> PressThresholds | None:
    """Return the fixed thresholds that were asked for, if any."""
    if args.full_scale is not None:
        return PressThresholds.of_full_scale(args.full_scale, PRESS_FRACTION if args.press is None else args.press,
                                             args.release)
    if args.press is not None or args.release is not None:
        raise InputError('thresholds', expected='--full-scale with --press or --release', got='no full scale',
                         remedy='Give the largest value that a taxel can have, or leave all three out.')
    return None


def _unusable(path: str, got: str) -> InputError:
    return InputError('standard input' if path == '-' else f'file {path!r}',
                      expected='a .npy array (K, rows, cols) or (rows, cols), bool, integer or float',
                      got=got,
                      remedy='Write one with numpy.save.')
