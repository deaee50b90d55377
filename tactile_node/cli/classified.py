"""Implement `tactile classify`: recognise each frame, alone or fused with earlier frames, and write its record."""

import argparse
import math
from collections.abc import Iterator

import numpy as np

from tactile_node.cli.frame_file import TaxelFrames
from tactile_node.cli.frame_patterns import files, taxels_known, thresholds
from tactile_node.cli.progress import show_progress
from tactile_node.cli.records import Record, write_records
from tactile_node.errors import InputError
from tactile_node.library.contacts import known_response
from tactile_node.pose.fit import ShapeFit
from tactile_node.pose.moments import check_pitch
from tactile_node.pose.pipeline import ContactPipeline, FoundContact, Taxels
from tactile_node.shape.methods import VisibilityGuard, make_recogniser
from tactile_node.shape.recognition import LEARNED, VOLF

POSE_NAMES = 'x', 'y', 'angle'
SIDE_NAMES = 'long', 'short'  #: sides of the smallest rectangle around a contact
BOX_NAMES = *POSE_NAMES, *SIDE_NAMES


def write_shapes(args: argparse.Namespace) -> None:
    if args.pitch is not None:
        check_pitch(args.pitch)
    recogniser = make_recogniser(args.method, {LEARNED: args.model, VOLF: args.curves}[args.method])
    write_records((record for path, found in files(args) for record in _records(path, found, recogniser, args)), args)


def _records(path: str, frames: TaxelFrames, recogniser: VisibilityGuard, args: argparse.Namespace) -> Iterator[Record]:
    """Yield one record per frame, computed from that frame alone or, with --fuse, also from the preceding frames."""
    pitch = frames.pitch if args.pitch is None else args.pitch
    response = known_response(args.response or None, frames.unit)
    stamps = _stamps(path, frames, args) if args.fuse else None
    taxels = Taxels(pitch or 1.0, frames.unit, None if response is None else response.layer)
    pipeline = ContactPipeline(recogniser, thresholds=thresholds(args), fits=bool(pitch),
                               curve=None if response is None else response.curve)
    for k, frame in enumerate(show_progress(frames.values, path, prints=args.output is None)):
        found = pipeline.find(frame, taxels, **taxels_known(frames, k))
        counted, fused = found.pattern, {}
        if stamps is None:
            found, recognition = pipeline.recognise_alone(found)
            fit = found.fit(recognition.shape) if pitch else None
        else:
            result = pipeline.recognise(found, float(stamps[k]))
            found, recognition, fit = result.found, result.fused.recognition, result.fit
            counted, fused = found.pattern, {'held': result.fused.held, 'fused_frames': result.fused.frames}
        yield {'file': path, 'frame': k, **frames.known_of(k), **recognition.as_json(), 'N': int(counted.mask.sum()),
               'contacts': counted.contacts, **fused, **_fitted(fit), **_boxed(found, pitch)}


def _stamps(path: str, found: TaxelFrames, args: argparse.Namespace) -> np.ndarray:
    if found.stamps is not None and args.period is None:
        return found.stamps
    if found.stamps is None and args.period is not None:
        return args.period * np.arange(len(found.values))
    got = 'both' if args.period else 'neither'
    raise InputError(f'file {path!r}, --fuse', expected='either stamps in the file or --period', got=got,
                     remedy='Write an .npz with `tactile replay`, or give the time between two frames as --period.')


def _boxed(found: FoundContact, pitch: float | None) -> Record:
    """Return the hollow fraction and, if the pitch is known, the smallest rectangle around the contact."""
    if not found.pattern.mask.any():
        return {}
    box = found.box
    if not pitch:
        return {'hollow': box.hollow}
    return {'hollow': box.hollow, 'box': {**dict(zip(BOX_NAMES, (*box.centre, box.angle, *box.lengths))),
                    'sd': dict(zip(BOX_NAMES, (box.centre_sd, box.centre_sd, box.angle_sd, *box.lengths_sd))),
                    'is_bound': dict(zip(SIDE_NAMES, box.length_is_bound))}}


def _fitted(fit: ShapeFit | None) -> Record:
    """Return pose and size with standard deviations. An undefined number, such as a circle's angle, is None."""
    if fit is None:
        return {}
    found = dict(zip(fit.parameter_names, fit.parameters))
    deviations = dict(zip(fit.parameter_names, np.sqrt(np.diag(fit.covariance))))
    return {**{name: _number(found.get(name)) for name in POSE_NAMES},
            'dimensions': {name: _number(found[name]) for name in fit.dimension_names},
            'sd': {name: _number(deviations.get(name)) for name in (*POSE_NAMES, *fit.dimension_names)},
            'is_bound': dict(zip(fit.dimension_names, fit.is_bound))}


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
