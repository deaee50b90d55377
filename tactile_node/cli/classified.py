"""Implement `tactile classify`: recognise each frame, alone or fused with earlier frames, and write its record."""

import argparse
import math
from collections.abc import Iterator

import numpy as np

from tactile_node.cli.frame_file import TaxelFrames
from tactile_node.cli.frame_patterns import files, patterns, taxels_known, thresholds
from tactile_node.cli.progress import show_progress
from tactile_node.cli.records import Record, write_records
from tactile_node.contact.pattern import ContactPattern
from tactile_node.errors import InputError
from tactile_node.learning.response import SkinResponse
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
    of_file = _fused if args.fuse else _single
    write_records((record for path, found in files(args) for record in of_file(path, found, recogniser, args)), args)


def _single(path: str, frames: TaxelFrames, recogniser: VisibilityGuard, args: argparse.Namespace) -> Iterator[Record]:
    """Yield one record per frame, computed from that frame alone."""
    pitch, response = _geometry(frames, args)
    if response is not None and frames.values.dtype != bool:
        frames = frames._replace(values=response.curve(frames.values))
    taxels, pipeline = _taxels(frames, pitch, response), ContactPipeline(recogniser)
    for k, pattern in enumerate(patterns(path, frames, args, largest=True)):
        found, recognition = pipeline.recognise_alone(FoundContact.of(pattern, taxels))
        fit = found.fit(recognition.shape) if pitch else None
        yield {'file': path, 'frame': k, **frames.known_of(k), **recognition.as_json(), **_counted(pattern),
               **_fitted(fit), **_boxed(found, pitch)}


def _fused(path: str, frames: TaxelFrames, recogniser: VisibilityGuard, args: argparse.Namespace) -> Iterator[Record]:
    """Yield one record per frame, fused with the preceding frames."""
    pitch, response = _geometry(frames, args)
    stamps, taxels = _stamps(path, frames, args), _taxels(frames, pitch, response)
    pipeline = ContactPipeline(recogniser, thresholds=thresholds(args), fits=bool(pitch),
                               curve=None if response is None else response.curve)
    for k, frame in enumerate(show_progress(frames.values, path, len(frames.values), prints=args.output is None)):
        result = pipeline.follow(frame, taxels, float(stamps[k]), **taxels_known(frames, k))
        fused = result.fused
        yield {'file': path, 'frame': k, **frames.known_of(k), **fused.recognition.as_json(),
               **_counted(result.found.pattern), 'held': fused.held, 'fused_frames': fused.frames,
               **_fitted(result.fit), **_boxed(result.found, pitch)}


def _taxels(frames: TaxelFrames, pitch: float | None, response: SkinResponse | None) -> Taxels:
    return Taxels(pitch or 1.0, frames.unit, None if response is None else response.layer)


def _stamps(path: str, found: TaxelFrames, args: argparse.Namespace) -> np.ndarray:
    if found.stamps is not None and args.period is None:
        return found.stamps
    if found.stamps is None and args.period is not None:
        return args.period * np.arange(len(found.values))
    got = 'both' if args.period else 'neither'
    raise InputError(f'file {path!r}, --fuse', expected='either stamps in the file or --period', got=got,
                     remedy='Write an .npz with `tactile replay`, or give the time between two frames as --period.')


def _geometry(found: TaxelFrames, args: argparse.Namespace) -> tuple[float | None, SkinResponse | None]:
    pitch = found.pitch if args.pitch is None else args.pitch
    return pitch, known_response(args.response or None, found.unit)


def _counted(pattern: ContactPattern) -> Record:
    return {'N': int(pattern.mask.sum()), 'contacts': pattern.contacts}


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
