"""The object between two pads, once, from what each of them says of its face.

Both faces of what a gripper holds are mostly one shape, seen from two sides: the right pad sees it mirrored.
"""

from collections.abc import Mapping, Sequence
from math import cos, hypot, isfinite, nan, pi, radians, remainder, sin, sqrt
from typing import NamedTuple

import numpy as np

from tactile_node.grasp.gripper import Gripper, PadPose, Point
from tactile_node.shape.recognition import Shape

#: Prior probability that both faces are of one class. A parallel gripper is closed on opposite faces of prisms, bars,
#: rods and plates, whose faces are alike; the rest leaves room for wedges, handles and lids. Assumed, not measured: of
#: two sides that are sure (0.99) of one class, or of two, the answer is the same with 0.5 and with 0.99.
SAME_FACES = 0.9
LEAST_PROBABILITY = 0.5  #: above which a class is reported: it is more probable than all else together
MOST_DEVIATIONS = 5.0    #: by which two angles of one object may differ; they are not quite normal
LEAST_CONTRADICTION = radians(5)  #: smaller differences are errors of the pads' poses, which no deviation knows
NO_CLASSES = (Shape.NONE.value, Shape.UNKNOWN.value)


class FaceFit(NamedTuple):
    """The outline of a face as fitted on its pad; angle, symmetry, handedness, names and bounds as in ContactShape."""

    angle: float                    #: of the shape's own x axis, x towards y of the pad [rad]
    angle_sd: float                 #: above 0 [rad]; inf where there is no angle
    symmetry: int
    handedness: int
    dimension_names: tuple[str, ...]
    dimensions: tuple[float, ...]   #: [m]
    dimension_sds: tuple[float, ...]  #: above 0 [m]
    dimension_is_bound: tuple[bool, ...]


class Face(NamedTuple):
    """What one pad reports of its contact; NaN where not known."""

    class_name: str                 #: of which ``fit`` is
    probabilities: Mapping[str, float]  #: by name of class, none and unknown included; they sum to 1
    centre: Point                   #: in the pad's frame [m]
    centre_sd: float                #: each way [m]
    fit: FaceFit | None
    force: float                    #: [N]
    force_sd: float                 #: [N]; NaN also where the noise of the taxels is not known
    force_is_bound: bool = False
    slope: Point = (nan, nan)       #: of the pressures along x and y of the pad [Pa/m]


class HeldObject(NamedTuple):
    """What both pads hold. By default nothing is known of it; fields as in Grasp.msg."""

    class_name: str = Shape.UNKNOWN.value
    confidence: float = 0.0
    centre: Point = (nan, nan)
    centre_sd: float = nan
    dimension_names: tuple[str, ...] = ()
    dimensions: tuple[float, ...] = ()
    dimension_sds: tuple[float, ...] = ()
    dimension_is_bound: tuple[bool, ...] = ()
    yaw: float = nan
    yaw_sd: float = nan
    symmetry: int = 0
    handedness: int = 0
    lean: Point = (nan, nan)
    grip_force: float = nan
    grip_force_sd: float = nan
    force_imbalance: float = nan


class _Turn(NamedTuple):
    """Rotation of one face as the left pad sees it."""

    symmetry: int
    angle: float
    sd: float
    handedness: int


def held_object(left: Face, right: Face, gripper: Gripper) -> HeldObject:
    """Return what both faces are together. Where neither has a fit of the common class there is no size, no yaw.

    >>> face = Face('circle', {'circle': 0.9, 'unknown': 0.1}, (0.01, 0.0), 1e-4, None, 2.0, 0.1)
    >>> found = held_object(face, face, Gripper())
    >>> found.class_name, round(found.confidence, 2), found.grip_force
    ('circle', 0.81, 2.0)
    """
    name, confidence = common_class(left.probabilities, right.probabilities)
    held = HeldObject(name, confidence, _centre(left.centre, right.centre, gripper),
                      hypot(left.centre_sd, right.centre_sd) / 2, lean=_lean(left, right, gripper))
    if all(isfinite(face.force) and not face.force_is_bound for face in (left, right)):
        held = held._replace(grip_force=(left.force + right.force) / 2, force_imbalance=left.force - right.force,
                             grip_force_sd=hypot(left.force_sd, right.force_sd) / 2)
    fits = [(face.fit, pad, side) for face, pad, side in ((left, gripper.left, 1), (right, gripper.right, -1))
            if face.fit is not None and face.class_name == name]
    if not fits:
        return held
    return _turned(_sized(held, [fit for fit, *_ in fits]), [_turn(*each, gripper) for each in fits])


def common_class(left: Mapping[str, float], right: Mapping[str, float]) -> tuple[str, float]:
    """Return the class that both faces are likeliest of, and the probability that both are; UNKNOWN up to 0.5.

    Of two faces of known classes, SAME_FACES are of one, and all classes are equally likely. A side that sees nothing
    or nothing known, with some probability, leaves the rest at most.
    """
    names = [name for name in {**left, **right} if name not in NO_CLASSES]
    both = {name: left.get(name, 0.0) * right.get(name, 0.0) for name in names}
    known = sum(left.get(name, 0.0) for name in names) * sum(right.get(name, 0.0) for name in names)
    if not known > 0:
        return Shape.UNKNOWN.value, 0.0
    alike = sum(both.values())
    apart = (1 - SAME_FACES) * (known - alike) / max(1, len(names) - 1)
    likeliest = max(both, key=both.__getitem__)
    confidence = min(1.0, known) * SAME_FACES * both[likeliest] / (SAME_FACES * alike + apart)
    return likeliest if confidence > LEAST_PROBABILITY else Shape.UNKNOWN.value, confidence


def _centre(left: Point, right: Point, gripper: Gripper) -> Point:
    """Return the midpoint as `HeldObject.centre`: the opening moves it along the closing direction alone."""
    middle = (gripper.left.place(left, 0.0) + gripper.right.place(right, 0.0)) / 2
    x, y = gripper.across @ (middle - gripper.left.origin)
    return float(x), float(y)


def _lean(left: Face, right: Face, gripper: Gripper) -> Point:
    """Return `HeldObject.lean`: what the pads feel alike is no rotation of the gripper's, and cancels."""
    rise = gripper.left.rotation[:, :2] @ left.slope - gripper.right.rotation[:, :2] @ right.slope
    x, y = gripper.across @ rise / 2
    return float(-y), float(x)


def _sized(held: HeldObject, fits: Sequence[FaceFit]) -> HeldObject:
    """Add the sizes of ``fits``, which are of the object's class."""
    names = fits[0].dimension_names
    of_each = zip(*(zip(fit.dimensions, fit.dimension_sds, fit.dimension_is_bound)
                    for fit in fits if fit.dimension_names == names))
    sizes, sds, bounds = zip(*map(_size, of_each))
    return held._replace(dimension_names=names, dimensions=sizes, dimension_sds=sds, dimension_is_bound=bounds)


def _size(seen: Sequence[tuple[float, float, bool]]) -> tuple[float, float, bool]:
    """Return one size, its deviation, and whether it is a bound, from the same of each side: the larger of bounds."""
    whole = [(size, sd) for size, sd, is_bound in seen if not is_bound]
    return (*_mean(whole), False) if whole else max(seen)


def _turn(fit: FaceFit, pad: PadPose, side: int, gripper: Gripper) -> _Turn:
    """Return how a face is turned; ``side``: 1 of the left pad, -1 of the right one.

    A mirrored outline with a handedness has its x axis where it was; any other, which is its own mirror image, its y.
    """
    quarter = 0.0 if fit.handedness else pi / 2
    x, y = gripper.across @ (pad.rotation[:, :2] @ (cos(fit.angle + quarter), sin(fit.angle + quarter)))
    return _Turn(fit.symmetry, float(np.arctan2(y, x)) - quarter, fit.angle_sd, side * fit.handedness)


def _turned(held: HeldObject, turns: Sequence[_Turn]) -> HeldObject:
    """Add the yaw, unless the sides contradict each other; the one that knows its apex says which turn is meant."""
    base = min(turns)
    held = held._replace(symmetry=base.symmetry)
    if not base.symmetry:
        return held
    angles = [base.angle + remainder(turn.angle - base.angle, 2 * pi / turn.symmetry) for turn in turns]
    most = max(LEAST_CONTRADICTION, MOST_DEVIATIONS * hypot(*(turn.sd for turn in turns)))
    if max(angles) - min(angles) > most or len({turn.handedness for turn in turns}) > 1:
        return held
    yaw, sd = _mean([(angle, turn.sd) for angle, turn in zip(angles, turns)])
    return held._replace(yaw=remainder(yaw, 2 * pi / base.symmetry), yaw_sd=sd, handedness=base.handedness)


def _mean(values: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Return the mean of ``values`` with standard deviations, weighted by their variances, and its deviation.

    Where they disagree by more than these explain, it is larger by the Birge ratio.
    """
    weights = [sd**-2 for _, sd in values]
    mean = sum(weight * value for weight, (value, _) in zip(weights, values)) / sum(weights)
    scatter = sum(weight * (value - mean)**2 for weight, (value, _) in zip(weights, values))
    return mean, sqrt(max(1.0, scatter / max(1, len(values) - 1)) / sum(weights))
