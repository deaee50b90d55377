"""The work of `tactile classify`: a record for each frame, alone or with those before it."""

import argparse
import math
from collections.abc import Iterator, Sequence

import numpy as np

from tactile_node.cli.frame_file import TaxelFrames
from tactile_node.cli.frame_patterns import files, patterns, taxels_known, thresholds
from tactile_node.cli.progress import followed
from tactile_node.cli.records import KNOWN, Record, prints, write_records
from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.errors import InputError
from tactile_node.learning.response import SkinResponse
from tactile_node.library.contacts import Recogniser, contact_box, fit_shape, known_response, recognised
from tactile_node.library.stream import ContactFollower
from tactile_node.pose.fit import ShapeFit
from tactile_node.pose.moments import check_pitch
from tactile_node.pose.outlines import OUTLINES
from tactile_node.shape.recognition import LEARNED, VOLF, Recognition, ShapeClass

POSE = 'x', 'y', 'angle'
SIDES = 'long', 'short'  #: of the least rectangle


def write_shapes(args: argparse.Namespace) -> None:
    for option in ('pitch', 'period'):
        if (length := getattr(args, option)) is not None:
            _check_length(option, length)
    recogniser = Recogniser(args.method, {LEARNED: args.weights, VOLF: args.curves}[args.method] or None)
    of_file = _fused if args.fuse else _single
    write_records((record for path, found in files(args) for record in of_file(path, found, recogniser, args)),
                  lambda: _columns(recogniser.classes), args)


def _single(path: str, found: TaxelFrames, recogniser: Recogniser, args: argparse.Namespace) -> Iterator[Record]:
    """Each frame for itself."""
    pitch, response = _geometry(found, args)
    if response is not None and found.values.dtype != bool:
        found = found._replace(values=response.curve(found.values))
    for k, pattern in enumerate(patterns(path, found, args, largest=True)):
        contact, recognition = recognised(recogniser, pattern)
        yield {'file': path, 'frame': k, **found.known_of(k), **recognition.as_json(), **_counted(pattern),
               **(_fitted(contact, recognition, pitch, response) if pitch else {}), **_boxed(contact, pitch)}


def _fused(path: str, found: TaxelFrames, recogniser: Recogniser, args: argparse.Namespace) -> Iterator[Record]:
    """Each frame with those before it."""
    pitch, response = _geometry(found, args)
    stamps = _stamps(path, found, args)
    extractor = PatternExtractor(thresholds(args), unit=found.unit)
    follower = ContactFollower(recogniser, extractor, pitch or 1.0, response=response)
    for k, frame in enumerate(followed(found.values, path, len(found.values), prints=prints(args))):
        contact, _, fused, fit = follower.follow(frame, float(stamps[k]), **taxels_known(found, k))
        yield {'file': path, 'frame': k, **found.known_of(k), **fused.recognition.as_json(), **_counted(contact),
               'held': fused.held, 'fused_frames': fused.frames, **(_as_json(fit) if pitch and fit else {}),
               **_boxed(contact, pitch)}


def _stamps(path: str, found: TaxelFrames, args: argparse.Namespace) -> np.ndarray:
    if found.stamps is not None and args.period is None:
        return found.stamps
    if found.stamps is None and args.period is not None:
        return args.period * np.arange(len(found.values))
    got = 'both' if args.period else 'neither'
    raise InputError(f'file {path!r}, --fuse', expected='stamps in the file or --period, one of them', got=got,
                     remedy='Write an .npz with `tactile replay`, or give the time between two frames.')


def _geometry(found: TaxelFrames, args: argparse.Namespace) -> tuple[float | None, SkinResponse | None]:
    pitch = found.pitch if args.pitch is None else args.pitch
    return pitch, known_response(args.response or None, found.unit)


def _check_length(option: str, length: float) -> None:
    if option == 'pitch':
        check_pitch(length)
    elif not 0 < length < math.inf:
        raise InputError(f'--{option}', expected='a time > 0 in seconds', got=str(length), remedy='Correct the number.')


def _columns(classes: Sequence[ShapeClass]) -> list[str]:
    """Return the names of all records' columns, in their order."""
    dimensions = list(dict.fromkeys(name for outline in OUTLINES.values() for name in outline.dimensions))
    return [*KNOWN, 'shape', 'reason', 'confidence',
            *(f'probabilities.{shape.value}' for shape in classes), 'N', 'contacts', 'held', 'fused_frames', 'hollow',
            *POSE, *(f'dimensions.{name}' for name in dimensions), *(f'sd.{name}' for name in (*POSE, *dimensions)),
            *(f'is_bound.{name}' for name in dimensions), *(f'box.{name}' for name in (*POSE, *SIDES)),
            *(f'box.sd.{name}' for name in (*POSE, *SIDES)), *(f'box.is_bound.{name}' for name in SIDES)]


def _counted(pattern: ContactPattern) -> Record:
    return {'N': int(pattern.mask.sum()), 'contacts': pattern.contacts}


def _fitted(contact: ContactPattern, recognition: Recognition, pitch: float, response: SkinResponse | None) -> Record:
    """Pose and size of a recognised shape with their standard deviations; nothing for another answer."""
    fit = fit_shape(contact, recognition.shape, pitch, response) if contact.mask.any() else None
    return _as_json(fit) if fit else {}


def _boxed(contact: ContactPattern, pitch: float | None) -> Record:
    """What is known of a contact whatever its shape; with a pitch the least rectangle around it."""
    if not contact.mask.any():
        return {}
    box = contact_box(contact, pitch or 1.0)
    if not pitch:
        return {'hollow': box.hollow}
    names = *POSE, *SIDES
    return {'hollow': box.hollow, 'box': {**dict(zip(names, (*box.centre, box.angle, *box.lengths))),
                    'sd': dict(zip(names, (box.centre_sd, box.centre_sd, box.angle_sd, *box.lengths_sd))),
                    'is_bound': dict(zip(SIDES, box.length_is_bound))}}


def _as_json(fit: ShapeFit) -> Record:
    """Numbers that are not known, as the angle of a circle, are None."""
    found = dict(zip(fit.parameter_names, fit.parameters))
    deviations = dict(zip(fit.parameter_names, np.sqrt(np.diag(fit.covariance))))
    return {**{name: _number(found.get(name)) for name in POSE},
            'dimensions': {name: _number(found[name]) for name in fit.dimension_names},
            'sd': {name: _number(deviations.get(name)) for name in (*POSE, *fit.dimension_names)},
            'is_bound': dict(zip(fit.dimension_names, fit.is_bound))}


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
