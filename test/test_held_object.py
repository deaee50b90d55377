"""Fusing the faces seen by both pads: hand-calculated results, random draws, and sides that contradict each other."""

import os
from math import atan2, cos, isnan, nan, pi, radians, sin

import numpy as np
import pytest

from tactile_node.grasp import held_object as module
from tactile_node.grasp.gripper import Gripper, PadPose
from tactile_node.grasp.held_object import SAME_FACES, Face, FaceFit, HeldObject, held_object

LONG = bool(os.environ.get('TACTILE_LONG'))
CLASSES = 'circle', 'square', 'rectangle', 'right_triangle', 'isosceles_triangle'
SYMMETRY = dict(zip(CLASSES, (0, 4, 2, 1, 1)))
SIZES = {'circle': ('radius',), 'square': ('side',), 'rectangle': ('long', 'short'),
         'right_triangle': ('long_leg', 'short_leg'), 'isosceles_triangle': ('base', 'height')}
DEFAULT = Gripper()
#: Both pads are rotated about the closing direction, which is the gripper's y axis. One is rotated by -90 degrees, the
#: other by an arbitrary angle.
TURNED = Gripper(PadPose((0.0, 0.0, 0.0), (-pi / 2, 0.0, 0.0)), PadPose((0.01, 0.0, 0.02), (pi / 2, 2.1, 0.0)))
#: The two pads do not quite face each other.
OBLIQUE = Gripper(PadPose((0.001, 0.0, 0.0), (0.1, 0.05, 0.3)), PadPose((0.0, 0.03, 0.0), (pi - 0.1, 0.0, 0.0)))
GRIPPERS = {'default': DEFAULT, 'turned': TURNED}


def probabilities(name='square', confidence=1.0, unknown=0.0):
    """Return the class probabilities, where the classes other than ``name`` share the remainder equally."""
    others = (1.0 - confidence - unknown) / (len(CLASSES) - 1)
    return {**dict.fromkeys(CLASSES, others), name: confidence, 'none': 0.0, 'unknown': unknown}


def fit(name='square', dimensions=None, angle=0.0, **changes):
    names = SIZES[name]
    found = FaceFit(angle=angle, angle_sd=0.01, symmetry=SYMMETRY[name], handedness=int(name == 'right_triangle'),
                    dimension_names=names, dimensions=dimensions or (0.02, 0.01)[:len(names)],
                    dimension_sds=(0.0001,) * len(names), dimension_is_bound=(False,) * len(names))
    return found._replace(**changes)


def face(name='square', fitted=True, **changes):
    shape = {key: changes.pop(key) for key in tuple(changes) if key in FaceFit._fields}
    found = Face(name, probabilities(name), (0.01, 0.02), 0.0001, fit(name, **shape) if fitted else None, 2.0, 0.1)
    return found._replace(**changes)


def held(left, right, gripper=DEFAULT):
    return held_object(left, right, gripper)


# The class.

def of_classes(left, right):
    found = held(face(probabilities=left, fitted=False), face(probabilities=right, fitted=False))
    return found.class_name, found.confidence


def test_two_faces_of_half_a_chance_are_as_likely_as_by_hand():
    """There are five classes, and both sides give circle and square a probability of 0.5 each.

    Equal faces have the weight 0.9 * (1/4 + 1/4), and two different faces have the weight 0.1 / 4 * 1/2.
    """
    half = {'circle': 0.5, 'square': 0.5, 'rectangle': 0.0, 'right_triangle': 0.0, 'isosceles_triangle': 0.0}
    assert SAME_FACES == 0.9
    name, confidence = of_classes(half, half)
    assert name == 'unknown' and confidence == pytest.approx(0.225 / (0.45 + 0.0125))


def test_a_doubtful_side_takes_the_class_of_a_sure_one():
    doubtful = {'circle': 0.5, 'square': 0.5, 'rectangle': 0.0, 'right_triangle': 0.0, 'isosceles_triangle': 0.0}
    name, confidence = of_classes(doubtful, probabilities('square'))
    assert name == 'square' and confidence == pytest.approx(0.45 / (0.45 + 0.0125))


def test_sides_that_are_sure_of_different_classes_are_of_none():
    assert of_classes(probabilities('circle', 0.99), probabilities('square', 0.99))[0] == 'unknown'
    assert of_classes(probabilities('circle'), probabilities('square')) == ('unknown', 0.0)


@pytest.mark.parametrize('mass', [0.1, 0.3, 0.6, 0.99, 1.0])
@pytest.mark.parametrize('of', ['unknown', 'none'])
@pytest.mark.parametrize('is_right', [False, True])
def test_the_uncertainty_of_a_side_lowers_the_confidence(mass, of, is_right):
    open_side = probabilities('square', 1 - mass, mass) | {'unknown': 0.0, of: mass}
    sides = (probabilities('square'), open_side)
    name, confidence = of_classes(*(sides if is_right else sides[::-1]))
    assert confidence == pytest.approx(1 - mass) and name == ('square' if mass < 0.5 else 'unknown')


def test_an_object_is_unknown_if_both_sides_are_unknown_or_have_no_classes():
    unknown = probabilities('square', 0.0, 1.0)
    assert of_classes(unknown, unknown) == of_classes({}, {}) == ('unknown', 0.0)


def test_a_class_that_only_one_side_knows_is_not_a_common_class():
    assert of_classes({'plug': 1.0, 'square': 0.0}, {'square': 1.0})[0] == 'unknown'
    assert of_classes({'plug': 0.9, 'unknown': 0.1}, {'plug': 1.0}) == ('plug', pytest.approx(0.9))


@pytest.mark.parametrize('same', [0.5, 0.99])
def test_the_result_of_two_certain_sides_does_not_depend_on_the_prior(same, monkeypatch):
    monkeypatch.setattr(module, 'SAME_FACES', same)
    circle, square = probabilities('circle', 0.99), probabilities('square', 0.99)
    assert of_classes(circle, square)[0] == 'unknown' and of_classes(circle, circle)[0] == 'circle'


@pytest.mark.slow
def test_confidences_are_frequencies():
    """Faces are drawn from the model, and each side is correct as often as its confidence claims.

    Of the classes reported with a confidence of 80 %, 80 % must be correct.
    """
    rng = np.random.default_rng(3)
    claimed, right = [], []
    draws = 20000 if LONG else 10000
    for _ in range(draws):
        left = rng.integers(5)
        true = left, left if rng.random() < SAME_FACES else (left + rng.integers(1, 5)) % 5
        said = []
        # A side reports the true class with probability 0.7, and otherwise one of the other classes.
        for index in true:
            name = CLASSES[index if rng.random() < 0.7 else (index + rng.integers(1, 5)) % 5]
            said.append(probabilities(name, 0.7))
        name, confidence = of_classes(*said)
        if name != 'unknown':
            claimed.append(confidence)
            right.append(CLASSES[true[0]] == CLASSES[true[1]] == name)
    assert len(right) > 0.4 * draws and np.mean(right) == pytest.approx(np.mean(claimed), abs=0.015)


# Sizes.

def test_sizes_are_weighted_by_their_variances():
    """The weighted mean of 20.0 +- 0.1 mm and 20.3 +- 0.2 mm is 20.06 mm.

    The standard deviation of this mean is sqrt(0.01 * 0.04 / 0.05) mm times sqrt(0.09 / 0.05).
    """
    found = held(face(dimensions=(0.0200,)), face(dimensions=(0.0203,), dimension_sds=(0.0002,)))
    assert found.dimension_names == ('side',) and found.dimension_is_bound == (False,)
    assert found.dimensions[0] == pytest.approx(0.02006)
    assert found.dimension_sds[0] == pytest.approx(1e-3 * np.sqrt(0.008) * np.sqrt(0.09 / 0.05))


def test_a_side_of_another_class_or_without_a_fit_gives_no_size():
    other = face('circle', probabilities=probabilities('square', 0.4), dimensions=(0.005,))
    for found in (held(face(), other), held(other, face()), held(face(), face(fitted=False))):
        assert found.class_name == 'square' and found.dimension_names == ('side',)
        assert found.dimensions == (0.02,) and found.dimension_sds == pytest.approx([0.0001])
    assert held(face(fitted=False), face(fitted=False)).dimensions == ()


def test_sizes_of_other_names_are_not_joined():
    """If the nodes of one side run another version, they may report other dimensions for a class."""
    found = held(face(), face(dimension_names=('width', 'height'), dimensions=(0.03, 0.02), dimension_sds=(1e-4,) * 2,
                              dimension_is_bound=(False,) * 2))
    assert (found.dimension_names, found.dimensions, found.dimension_is_bound) == (('side',), (0.02,), (False,))


@pytest.mark.parametrize(('bounds', 'expected'), [
    (((True, False), (False, False)), ((0.030, False), (0.0095, False))),
    (((False, False), (True, False)), ((0.020, False), (0.0095, False))),
    (((True, False), (True, True)), ((0.030, True), (0.010, False)))])
def test_a_size_replaces_a_bound_and_the_larger_of_two_bounds_is_used(bounds, expected):
    found = held(*(face('rectangle', dimensions=sizes, dimension_is_bound=each)
                   for sizes, each in zip(((0.020, 0.010), (0.030, 0.009)), bounds)))
    assert found.dimension_is_bound == tuple(is_bound for _, is_bound in expected)
    assert found.dimensions == pytest.approx([size for size, _ in expected])


# Rotation and place.

def angle_on(pad, direction):
    """Return the angle of ``direction`` (3,) in the pad's frame, from x towards y."""
    x, y = pad.rotation[:, :2].T @ direction
    return atan2(y, x)


def faces_of(name, yaw, gripper, noise=(0.0, 0.0), **changes):
    """Return the faces of one prism on both pads, where the left pad sees the outline at the angle ``yaw``.

    The geometry in this function is written independently of the package. In each pad's own sense of rotation, the x
    axis of the isosceles triangle lies a quarter turn before its apex. All other outlines have their x axis along an
    edge.
    """
    left, right = gripper.left, gripper.right
    x = left.rotation[:, :2] @ (cos(yaw), sin(yaw))
    apex = left.rotation[:, :2] @ (-sin(yaw), cos(yaw))
    on_right = angle_on(right, apex) - pi / 2 if name == 'isosceles_triangle' else angle_on(right, x)
    handed = int(name == 'right_triangle')
    return (face(name, angle=yaw + noise[0], handedness=handed, **changes),
            face(name, angle=on_right + noise[1], handedness=-handed, **changes))


@pytest.mark.parametrize('gripper', GRIPPERS.values(), ids=GRIPPERS)
@pytest.mark.parametrize('name', CLASSES[1:])
@pytest.mark.parametrize('yaw', np.linspace(-3.0, 3.0, 7))
def test_both_faces_of_a_prism_have_one_yaw(name, yaw, gripper):
    found = held(*faces_of(name, yaw, gripper), gripper)
    period = 2 * pi / SYMMETRY[name]
    assert found.symmetry == SYMMETRY[name]
    assert abs(found.yaw) <= period / 2 + 1e-9
    assert np.remainder(found.yaw - yaw + 1, period) == pytest.approx(np.remainder(1, period))
    assert found.yaw_sd == pytest.approx(0.01 / np.sqrt(2))
    assert found.handedness == (1 if name == 'right_triangle' else 0)


def test_the_default_pads_mirror_angles_as_by_hand():
    """The right pad is rotated by half a turn about x.

    On the right pad, an edge at 20 degrees appears at -20 degrees. On the right pad, an apex at 110 degrees (x at 20)
    appears at -110 degrees.
    """
    angle = radians(20)
    assert held(face('rectangle', angle=angle), face('rectangle', angle=-angle)).yaw == pytest.approx(angle)
    apex = held(face('isosceles_triangle', angle=angle), face('isosceles_triangle', angle=-angle - pi))
    assert apex.yaw == pytest.approx(angle)


@pytest.mark.parametrize('gripper', GRIPPERS.values(), ids=GRIPPERS)
def test_right_triangles_that_do_not_mirror_each_other_have_no_yaw(gripper):
    left, right = faces_of('right_triangle', 0.4, gripper)
    right = right._replace(fit=right.fit._replace(handedness=left.fit.handedness))
    found = held(left, right, gripper)
    assert isnan(found.yaw) and isnan(found.yaw_sd) and found.handedness == 0 and found.symmetry == 1
    assert found.class_name == 'right_triangle' and found.dimensions


def test_right_faces_alone_are_seen_as_by_the_left_pad():
    left, right = faces_of('right_triangle', 0.4, TURNED)
    found = held(left._replace(fit=None), right, TURNED)
    assert found.yaw == pytest.approx(0.4) and (found.handedness, found.symmetry) == (left.fit.handedness, 1)


@pytest.mark.parametrize(('sds', 'apart', 'is_known'), [
    (0.01, radians(4.9), True), (0.01, radians(5.1), False),  # Five standard deviations are 4.05 degrees.
    (0.03, radians(12.0), True), (0.03, radians(12.3), False)])  # Five standard deviations are 12.15 degrees.
def test_yaws_that_contradict_each_other_give_no_yaw(sds, apart, is_known):
    found = held(face(angle=0.0, angle_sd=sds), face(angle=-apart, angle_sd=sds))
    assert isnan(found.yaw) == isnan(found.yaw_sd) != is_known and found.symmetry == 4
    if is_known:  # The Birge ratio, here apart / (sqrt(2) sds), widens the standard deviation.
        assert found.yaw == pytest.approx(apart / 2) and found.yaw_sd == pytest.approx(apart / 2)


def test_the_apex_is_known_if_one_side_knows_it():
    left, right = faces_of('isosceles_triangle', 2.0, DEFAULT)
    doubtful = right._replace(fit=right.fit._replace(symmetry=3, angle=right.fit.angle + 2 * pi / 3))
    found = held(left, doubtful)
    assert found.yaw == pytest.approx(2.0) and found.symmetry == 1
    both = held(left._replace(fit=left.fit._replace(symmetry=3)), doubtful)
    assert both.symmetry == 3 and both.yaw == pytest.approx(2.0 - 2 * pi / 3)


def test_a_circle_and_a_taught_shape_have_no_yaw():
    taught = face(fitted=False, probabilities={'plug': 1.0})._replace(class_name='plug')
    for found in (held(face('circle'), face('circle')), held(taught, taught)):
        assert isnan(found.yaw) and isnan(found.yaw_sd) and found.symmetry == 0


@pytest.mark.parametrize('gripper', [DEFAULT, TURNED, OBLIQUE], ids=['default', 'turned', 'oblique'])
def test_the_centre_is_that_of_the_line_at_any_opening(gripper):
    """The centre is measured from the left pad's origin, along its axes projected across the closing direction."""
    left, right = (0.012, 0.004), (0.011, -0.003)
    found = held(face(centre=left), face(centre=right), gripper)
    closing = gripper.closing
    x = gripper.left.rotation[:, 0] - gripper.left.rotation[:, 0] @ closing * closing
    x /= np.linalg.norm(x)
    for gap in (0.0, 0.05):
        middle = (gripper.left.place(left, gap) + gripper.right.place(right, gap)) / 2
        away = middle - gripper.left.place((0.0, 0.0), gap)
        assert found.centre == pytest.approx((away @ x, away @ np.cross(closing, x)))
    assert found.centre_sd == pytest.approx(0.0001 / np.sqrt(2))


def test_a_centre_that_a_side_does_not_know_is_not_known():
    assert np.isnan(held(face(), face(centre=(nan, nan))).centre).all()


# Force.

def test_the_grip_is_the_mean_of_both_forces():
    found = held(face(force=3.0, force_sd=0.3), face(force=2.0, force_sd=0.4))
    assert (found.grip_force, found.force_imbalance) == (2.5, 1.0)
    assert found.grip_force_sd == pytest.approx(0.25)


def test_without_the_noise_of_the_taxels_the_grip_is_known_and_its_deviation_is_not():
    found = held(face(force_sd=nan), face())
    assert found.grip_force == 2.0 and isnan(found.grip_force_sd)


@pytest.mark.parametrize('changes', [{'force': nan}, {'force_is_bound': True}])
def test_the_grip_force_is_unknown_if_one_force_is_unknown(changes):
    for found in (held(face(**changes), face()), held(face(), face(**changes))):
        assert np.isnan((found.grip_force, found.grip_force_sd, found.force_imbalance)).all()


# Slopes of the faces.

@pytest.mark.parametrize('gripper', GRIPPERS.values(), ids=GRIPPERS)
@pytest.mark.parametrize('turn', [(0.1, 0.0), (0.0, -0.2), (0.15, 0.1)])
def test_faces_lean_as_the_object_is_turned(gripper, turn):
    """Two parallel planes are tilted by small angles about the left pad's x and y axes.

    The expected depth in each pad is worked out by hand. The planes are z = -l and z = l along the left pad's z axis.
    Only the cross product of ``turn`` and the position changes the depth: the left pad reads more where the plane is
    lower.
    """
    rate = 3e6  # Pressure per depth [Pa/m].
    x, y = gripper.left.rotation[:, 0], gripper.left.rotation[:, 1]
    rotation = turn[0] * x + turn[1] * y
    slopes = []
    for pad in (gripper.left, gripper.right):
        # Displacement of the point that lies 1 m along the pad's axis.
        moved = [np.cross(rotation, pad.rotation[:, axis]) for axis in (0, 1)]
        slopes.append(tuple(-rate * float(each @ pad.normal) for each in moved))
    found = held(*(face(slope=slope) for slope in slopes), gripper)
    assert found.lean == pytest.approx((rate * turn[0], rate * turn[1]), abs=1.0)
    assert np.isnan(held(face(slope=slopes[0]), face(), gripper).lean).all()


def test_a_wedge_that_both_pads_feel_equally_has_no_lean():
    """Both faces rise towards the same side, so no rotation makes both flat."""
    assert held(face(slope=(1e6, 0.0)), face(slope=(1e6, 0.0))).lean == pytest.approx((0.0, 0.0))


# All results together.

def test_without_a_class_there_is_neither_size_nor_yaw_but_a_place_and_a_force():
    found = held(face('circle'), face('square'))
    assert (found.class_name, found.symmetry, found.dimensions) == ('unknown', 0, ()) and isnan(found.yaw)
    assert np.isfinite((*found.centre, found.grip_force)).all()


def test_nothing_known_claims_nothing():
    found = HeldObject()
    assert (found.class_name, found.confidence, found.dimensions, found.symmetry) == ('unknown', 0.0, (), 0)
    assert np.isnan((*found.centre, found.centre_sd, found.yaw, found.yaw_sd, found.grip_force, found.grip_force_sd,
                     found.force_imbalance, *found.lean)).all()


@pytest.mark.parametrize('gripper', GRIPPERS.values(), ids=GRIPPERS)
@pytest.mark.parametrize('name', CLASSES[1:])
def test_true_values_are_within_two_deviations_as_often_as_they_should_be(name, gripper):
    """For normally distributed errors, 95.4 % of the values lie within two standard deviations.

    The share is larger if two results disagree by chance, because the Birge ratio then widens the standard deviation.
    """
    rng, inside, widths = np.random.default_rng(7), [], []
    for _ in range(2000 if LONG else 1000):
        yaw, sds = rng.uniform(-pi, pi), rng.uniform(0.005, 0.02, 2)
        size, size_sds = rng.uniform(0.01, 0.03), rng.uniform(1e-4, 4e-4, 2)
        count, faces = len(SIZES[name]), faces_of(name, yaw, gripper, sds * rng.standard_normal(2))
        fits = [each.fit._replace(angle_sd=angle_sd, dimension_sds=(size_sd,) * count,
                                  dimensions=(size + size_sd * rng.standard_normal(),) * count)
                for each, angle_sd, size_sd in zip(faces, sds, size_sds)]
        found = held(*(each._replace(fit=fitted) for each, fitted in zip(faces, fits)), gripper)
        period = 2 * pi / SYMMETRY[name]
        off = abs(np.remainder(found.yaw - yaw + period / 2, period) - period / 2)
        inside.append((off <= 2 * found.yaw_sd, abs(found.dimensions[0] - size) <= 2 * found.dimension_sds[0]))
        widths.append(found.dimension_sds[0] / np.sqrt(1 / np.sum(size_sds**-2.0)))
    assert np.all(np.mean(inside, axis=0) >= 0.95) and np.all(np.mean(inside, axis=0) <= 0.99)
    assert np.mean(widths) < 1.3  # The standard deviation must not pass the checks above only because it is too wide.
