"""Read the frames for `tactile features` and `tactile classify`, and write the features of each frame."""

import argparse
import sys
from collections.abc import Iterator

import numpy as np

from tactile_node.cli.frame_file import TaxelFrames, read_frames
from tactile_node.cli.frame_png import Greys
from tactile_node.cli.progress import show_progress
from tactile_node.cli.records import Record, write_records
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PRESS_FRACTION, PressThresholds
from tactile_node.contact.unit_scale import UnitScale
from tactile_node.errors import InputError
from tactile_node.helmholtz.features import compute_features
from tactile_node.library.contacts import check_values
from tactile_node.taxel_frame import TaxelStatus

LONG = 4  #: minimum ratio of rows to columns at which a single frame is probably a list of frames, one per line
LEAST_FLAT = 16  #: minimum length of a line that may be a whole frame [taxels]: the size of a small pad


def files(args: argparse.Namespace) -> Iterator[tuple[str, TaxelFrames]]:
    """Yield the name and the frames of each input file.

    Raises
    ------
    InputError
        Raised if a unit contradicts the file or its values, or if a file cannot be read.
    """
    greys = Greys(args.black, args.white)
    if not np.isfinite(greys).all() or greys.black == greys.white:
        raise InputError('--black, --white', expected='two different numbers', got=f'{greys.black}, {greys.white}',
                         remedy='To use fractions of full scale, leave both options out.')
    for path in args.frames:
        found = read_frames(path, greys)
        if args.unit is not None and found.unit not in (None, args.unit):
            raise InputError(f'file {path!r}', expected=f'values in {args.unit!r}, as --unit says',
                             got=f'the unit {found.unit!r}',
                             remedy='Leave --unit out, because the file contains its unit.')
        found = found._replace(unit=args.unit or found.unit)
        frames, rows, cols = found.values.shape
        if frames == 1 and cols >= LEAST_FLAT and rows >= LONG * cols:
            print(f'tactile: warning: {path}: read as one frame of {rows} x {cols} taxels. If each line is a whole '
                  'frame, reshape the array: docs/howto/without_ros.md shows two lines of NumPy.', file=sys.stderr)
        if thresholds(args) is None and found.values.size:
            check_values(found.values, found.unit)
            if error := next(filter(None, map(UnitScale(found.unit, most=1.0).doubt, found.values)), None):
                print(f'tactile: warning: {path}: {error}', file=sys.stderr)
        yield path, found


def taxels_known(found: TaxelFrames, k: int) -> dict[str, np.ndarray]:
    """Return masks of the saturated and the unmapped taxels in frame ``k``, or no masks if the file has no status."""
    if found.status is None:
        return {}
    return {'saturated': found.status[k] == TaxelStatus.SATURATED, 'unmapped': found.status[k] == TaxelStatus.UNMAPPED}


def thresholds(args: argparse.Namespace) -> PressThresholds | None:
    """Return the fixed thresholds from the options, or None if there are none."""
    if args.full_scale is not None:
        return PressThresholds.of_full_scale(args.full_scale, PRESS_FRACTION if args.press is None else args.press,
                                             args.release)
    if args.press is not None or args.release is not None:
        raise InputError('thresholds', expected='--full-scale with --press or --release', got='no --full-scale',
                         remedy='Give the largest value that a taxel can have as --full-scale, or leave all three '
                         'options out.')
    return None


def write_features(args: argparse.Namespace) -> None:
    write_records(_records(args), args)


def _records(args: argparse.Namespace) -> Iterator[Record]:
    for path, found in files(args):
        extractor = PatternExtractor(thresholds(args), unit=found.unit, largest=args.largest_contact)
        for k, frame in enumerate(show_progress(found.values, path, prints=args.output is None)):
            pattern = extractor.extract(frame, **taxels_known(found, k))
            yield {'file': path, 'frame': k, **found.known_of(k),
                   **compute_features(pattern.mask, args.groups).as_json()}
