"""Pose fits are compared with known contacts, closed-form solutions and numerical derivatives."""

import numpy as np
import pytest

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.errors import InputError
from tactile_node.pose.fit import fit_shape
from tactile_node.pose.outlines import OUTLINES, Window, depth_inside, moving_depth, outline_of
from tactile_node.pose.skin_model import Model, PressureModel
from tactile_node.shape.recognition import Shape
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import CLASSES, Contact, random_contact
from training.ground_truth.raster import coverage
from training.ground_truth.seeds import Purpose, generator

WINDOW = Window(0, 0, 20, 20)
PITCH = 0.002


def parameters_of(contact):
    outline = OUTLINES[Shape(contact.shape)]
    return np.array([contact.x, contact.y, *([contact.angle] if outline.symmetry else []),
                     *contact.dimensions[:len(outline.dimensions)]])


def contacts(count=1, area=40.0, seed=11, pad=20):
    rng = generator(Purpose.TEST, seed)
    return [random_contact(rng, shape, area, rows=pad, cols=pad) for shape in CLASSES for _ in range(count)]


def pressed(values):
    return PatternExtractor(PressThresholds(15e3, 12e3)).extract(values).mask


def angle_apart(a, b, symmetry):
    return abs((a - b + np.pi / symmetry) % (2 * np.pi / symmetry) - np.pi / symmetry)


def numerical(function, parameters, step=1e-5):
    steps = np.eye(len(parameters)) * step
    return np.array([(function(parameters + each) - function(parameters - each)) / (2 * step)
                     for each in steps])


# Tests of outlines, coverage and models.


@pytest.mark.parametrize('contact', contacts(2), ids=lambda c: c.shape)
def test_coverage_agrees_with_counting_points(contact):
    outline = outline_of(Shape(contact.shape), contact.handedness)
    corners, motions = outline.moving(parameters_of(contact), np.ones((1, len(outline.dimensions))))
    covered, _ = coverage(corners[0], motions[:, 0], WINDOW)
    step = (np.arange(40) + 0.5) / 40 - 0.5
    y = (WINDOW.row + np.arange(WINDOW.rows))[:, None] + step
    x = (WINDOW.col + np.arange(WINDOW.cols))[:, None] + step
    x, y = np.meshgrid(x.ravel(), y.ravel())
    counted = (contact.depth(x, y) >= 0).reshape(WINDOW.rows, 40, WINDOW.cols, 40).mean((1, 3))
    assert np.abs(covered - counted).max() < 0.01
    assert covered.sum() == pytest.approx(contact.area)


@pytest.mark.parametrize('contact', contacts(1), ids=lambda c: c.shape)
@pytest.mark.parametrize('kind', ['pressure', 'pattern'])
def test_jacobians_are_the_derivatives(contact, kind):
    outline = outline_of(Shape(contact.shape), contact.handedness)
    model = (PressureModel(outline, WINDOW, np.array([9.0, 9.5])) if kind == 'pressure'
             else Model(outline, WINDOW))
    extras = [1.1, 0.02, -0.03, 0.6, -0.4] if kind == 'pressure' else []
    parameters = np.concatenate((parameters_of(contact), extras))
    expected = numerical(lambda p: model.predict(p).values, parameters)
    assert model.predict(parameters).jacobian == pytest.approx(expected, abs=2e-5)


def test_depth_inside_of_a_square_by_hand():
    corners, places = np.array([[0., 0], [4, 0], [4, 4], [0, 4]]), np.array([[1., 2, 5], [2, 3.5, 2]])
    assert depth_inside(corners, *places) == pytest.approx([1, 0.5, -1])
    assert moving_depth(corners, np.zeros((1, 4, 2)), places)[0] == pytest.approx([1, 0.5, -1])


# Fits.

@pytest.mark.parametrize('contact', contacts(2), ids=lambda c: c.shape)
def test_clean_pressure_frames_give_the_pose_back_in_metres(contact):
    values = pressure_frame(contact, generator(Purpose.TEST, 1), 20, 20)
    fit = fit_shape(values, pressed(values), Shape(contact.shape), PITCH)
    assert np.hypot(*np.subtract(fit.centre, (contact.x * PITCH, contact.y * PITCH))) < 0.05 * PITCH
    expected = np.multiply(contact.dimensions[:len(fit.dimensions)], PITCH)
    assert fit.dimensions == pytest.approx(expected.tolist(), rel=0.02)
    if fit.symmetry:
        assert np.degrees(angle_apart(fit.angle, contact.angle, fit.symmetry)) < 1.5
    if fit.shape is Shape.RIGHT_TRIANGLE:
        assert fit.handedness == contact.dimensions[2]
    assert fit.residual < 0.02 and len(fit.parameter_names) == len(fit.parameters) == len(fit.covariance)
    assert (np.linalg.eigvalsh(fit.covariance) > 0).all()


@pytest.mark.parametrize('contact', contacts(1), ids=lambda c: c.shape)
def test_field_conditions_leave_the_fit_near(contact):
    rng, skin = generator(Purpose.TEST, 2), Skin(noise=0.01, blur=0.5, dead=0.03)
    values = pressure_frame(contact, rng, 20, 20, tilt=(0.03, -0.03), skin=skin)
    fit = fit_shape(values, pressed(values), Shape(contact.shape))
    assert np.hypot(fit.centre[0] - contact.x, fit.centre[1] - contact.y) < 0.15
    assert fit.dimensions == pytest.approx(contact.dimensions[:len(fit.dimensions)], rel=0.05)


def test_a_frame_with_a_hole_is_a_square_by_its_outline():
    outer = Contact('square', (9.0,), 10.2, 9.8, angle=0.4)
    inner = Contact('square', (4.0,), 10.2, 9.8, angle=0.4)
    rng = generator(Purpose.TEST, 4)
    values = pressure_frame(outer, rng, 20, 20) - pressure_frame(inner, rng, 20, 20)
    fit = fit_shape(values, values > 15e3, Shape.SQUARE)
    assert fit.dimensions[0] == pytest.approx(9.0, abs=0.1)
    assert fit.centre == pytest.approx((10.2, 9.8), abs=0.1)


def test_shapes_without_an_outline_have_no_fit_and_wrong_input_is_refused():
    mask = np.ones((4, 4), bool)
    assert fit_shape(mask, mask, Shape.UNKNOWN) is None and fit_shape(mask, mask, Shape.NONE) is None
    with pytest.raises(InputError, match='at least one taxel'):
        fit_shape(mask, ~mask, Shape.CIRCLE)
    with pytest.raises(InputError):
        fit_shape(np.ones((4, 5)), mask, Shape.CIRCLE)


@pytest.mark.parametrize('shape', OUTLINES)
@pytest.mark.parametrize('mask', [np.eye(6, dtype=bool)[:1], np.eye(9, dtype=bool), np.ones((3, 8), bool),
                                  np.ones((1, 1), bool)],
                         ids=['one', 'diagonal', 'full pad', 'one taxel pad'])
@pytest.mark.parametrize('kind', ['on/off', 'pressure', 'dead'])
def test_odd_contacts_give_finite_numbers(shape, mask, kind):
    values = {'on/off': mask, 'pressure': mask * 1234.5, 'dead': np.where(mask, np.nan, 0.0)}[kind]
    fit = fit_shape(values, mask, shape)
    assert np.isfinite(fit.parameters).all() and np.isfinite(fit.covariance).all()


# Solids.

def test_solids_and_pose_covariance():
    contact = contacts(1)[2]
    values = pressure_frame(contact, generator(Purpose.TEST, 1), 20, 20)
    fit = fit_shape(values, values > 15e3, Shape.RECTANGLE, PITCH)
    assert fit.solid(0.01) == ('box', (*fit.dimensions, 0.01))
    covariance = fit.pose_covariance
    assert covariance[0, 5] == fit.covariance[0, 2] and covariance[5, 5] == fit.covariance[2, 2]
    assert not covariance[2:5].any()


@pytest.mark.parametrize('contact', contacts(1), ids=lambda c: c.shape)
def test_a_prism_is_closed_and_has_the_volume_of_its_base(contact):
    values = pressure_frame(contact, generator(Purpose.TEST, 1), 20, 20)
    fit = fit_shape(values, values > 15e3, Shape(contact.shape))
    vertices, triangles = fit.prism(3.0)
    corners = vertices[triangles]
    volume = np.einsum('ij,ij->i', corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    x, y = fit.outline.T
    base = (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2
    assert volume == pytest.approx(3 * base)  # The volume is positive only if all triangles face outwards.
    assert base == pytest.approx(contact.area, rel=0.04)
    edges = {(a, b) for t in triangles.tolist() for a, b in zip(t, t[1:] + t[:1])}
    assert len(edges) == 3 * len(triangles) and edges == {(b, a) for a, b in edges}
