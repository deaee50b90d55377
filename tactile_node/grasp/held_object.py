"""Combine the reports of two pads about their contacts into one description of the object between the pads.

Both faces of a held object usually have the same shape. The two pads see the faces from opposite sides, so the right
pad sees the shape mirrored.
"""

from collections.abc import Mapping, Sequence
from math import cos, hypot, isfinite, nan, pi, radians, remainder, sin, sqrt
from typing import NamedTuple

import numpy as np

from tactile_node.grasp.gripper import Gripper, PadPose, Point
from tactile_node.shape.recognition import Shape

#: Prior probability that both faces have the same class. A parallel gripper usually closes on opposite faces of prisms,
#: bars, rods and plates, whose faces are alike. The remaining probability allows for wedges, handles and lids. The
#: value is assumed, not measured. If both sides report the same class, or two different classes, with a probability of
#: 0.99, then a prior of 0.5 and a prior of 0.99 lead to the same class.
SAME_FACES = 0.9
#: Probability above which a class is reported, because the class is then more probable than all others together.
LEAST_PROBABILITY = 0.5
#: Largest difference between two angles of one object [standard deviations]. The limit is high because the errors are
#: not quite normally distributed.
MOST_DEVIATIONS = 5.0
#: Angles that differ by less than this do not contradict each other [rad]. Such a small difference can come from errors
#: in the poses of the pads, which the standard deviations do not include.
LEAST_CONTRADICTION = radians(5)
NO_CLASSES = (Shape.NONE.value, Shape.UNKNOWN.value)


class FaceFit(NamedTuple):
    """The outline of a face, as fitted on its pad.

    The angle, symmetry, handedness, names and bounds are defined as in ContactShape.msg.
    """

    angle: float     #: angle of the shape's own x axis, positive from the x axis to the y axis of the pad [rad]
    angle_sd: float  #: standard deviation of the angle, above 0 [rad]; inf if the shape has no angle
    symmetry: int
    handedness: int
    dimension_names: tuple[str, ...]
    dimensions: tuple[float, ...]     #: [m]
    dimension_sds: tuple[float, ...]  #: above 0 [m]
    dimension_is_bound: tuple[bool, ...]


class Face(NamedTuple):
    """The report of one pad about its contact, with NaN for unknown values."""

    class_name: str                     #: class of ``fit``
    probabilities: Mapping[str, float]  #: probability of each class by name, including none and unknown; the sum is 1
    centre: Point                       #: centre in the pad frame [m]
    centre_sd: float                    #: standard deviation along each axis [m]
    fit: FaceFit | None
    force: float     #: [N]
    force_sd: float  #: standard deviation of the force [N]; NaN if the noise of the taxels is unknown
    force_is_bound: bool = False
    slope: Point = (nan, nan)  #: pressure gradient along x and y of the pad [Pa/m]


class HeldObject(NamedTuple):
    """The object that both pads hold.

    By default, all properties of the object are unknown. The fields are those of Grasp.msg.
    """

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
    """Rotation of one face, as seen from the left pad."""

    symmetry: int
    angle: float
    sd: float
    handedness: int


def held_object(left: Face, right: Face, gripper: Gripper) -> HeldObject:
    """Return the object to which both faces belong.

    If neither face has a fit of the common class, the size and yaw of the object are unknown.

    Parameters
    ----------
    left, right : Face
        Reports of the two pads.
    gripper : Gripper
        Poses of the pads.

    Examples
    --------
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
    """Return the most probable class of both faces, and the probability that both faces have it.

    The prior assumes that both faces have the same class with the probability SAME_FACES, and that all classes are
    equally likely. The probability that a side assigns to none or unknown supports no class.

    Parameters
    ----------
    left, right : mapping of str to float
        Probability of each class by name.

    Returns
    -------
    name : str
        The class, or UNKNOWN if its probability is at most 0.5.
    probability : float
        Probability that both faces have this class.
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
    """Return the midpoint between both centres for `HeldObject.centre`.

    The opening moves the midpoint only along the closing direction, so the opening is not needed.
    """
    middle = (gripper.left.place(left, 0.0) + gripper.right.place(right, 0.0)) / 2
    x, y = gripper.across @ (middle - gripper.left.origin)
    return float(x), float(y)


def _lean(left: Face, right: Face, gripper: Gripper) -> Point:
    """Return `HeldObject.lean`.

    A rotation of the gripper does not cause the same pressure gradient on both pads, so a gradient common to both pads
    cancels out.
    """
    rise = gripper.left.rotation[:, :2] @ left.slope - gripper.right.rotation[:, :2] @ right.slope
    x, y = gripper.across @ rise / 2
    return float(-y), float(x)


def _sized(held: HeldObject, fits: Sequence[FaceFit]) -> HeldObject:
    """Return the object with the sizes from ``fits``, which all have the object's class."""
    names = fits[0].dimension_names
    of_each = zip(*(zip(fit.dimensions, fit.dimension_sds, fit.dimension_is_bound)
                    for fit in fits if fit.dimension_names == names))
    sizes, sds, bounds = zip(*map(_size, of_each))
    return held._replace(dimension_names=names, dimensions=sizes, dimension_sds=sds, dimension_is_bound=bounds)


def _size(seen: Sequence[tuple[float, float, bool]]) -> tuple[float, float, bool]:
    """Combine the sizes that each side reports into one size, its standard deviation, and a flag for a bound.

    A bound is used only if every reported size is a bound. The largest bound is then returned.
    """
    whole = [(size, sd) for size, sd, is_bound in seen if not is_bound]
    return (*_mean(whole), False) if whole else max(seen)


def _turn(fit: FaceFit, pad: PadPose, side: int, gripper: Gripper) -> _Turn:
    """Return the rotation of a face.

    ``side`` is 1 for the left pad and -1 for the right pad. In a mirrored view, an outline with a handedness keeps the
    direction of its x axis. Any other outline is its own mirror image and keeps the direction of its y axis.
    """
    quarter = 0.0 if fit.handedness else pi / 2
    x, y = gripper.across @ (pad.rotation[:, :2] @ (cos(fit.angle + quarter), sin(fit.angle + quarter)))
    return _Turn(fit.symmetry, float(np.arctan2(y, x)) - quarter, fit.angle_sd, side * fit.handedness)


def _turned(held: HeldObject, turns: Sequence[_Turn]) -> HeldObject:
    """Return the object with its yaw, unless the two sides contradict each other.

    If one side has identified the apex, the rotation on that side determines which of the equivalent rotations is
    correct.
    """
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
    """Return the weighted mean of values and its standard deviation.

    ``values`` holds pairs of a value and its standard deviation. The weights are 1 / variance. If the values differ by
    more than their standard deviations explain, the Birge ratio enlarges the standard deviation of the mean.
    """
    weights = [sd**-2 for _, sd in values]
    mean = sum(weight * value for weight, (value, _) in zip(weights, values)) / sum(weights)
    scatter = sum(weight * (value - mean)**2 for weight, (value, _) in zip(weights, values))
    return mean, sqrt(max(1.0, scatter / max(1, len(values) - 1)) / sum(weights))
