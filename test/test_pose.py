"""Pose fits against known contacts, closed forms and numerical derivatives."""

import numpy as np
import pytest

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.errors import InputError
from tactile_node.pose.first_guess import guesses, moments_of
from tactile_node.pose.fit import fit_shape
from tactile_node.pose.outlines import OUTLINES, Window, depth_inside, moving_depth, outline_of
from tactile_node.pose.skin_model import Model, PressureModel
from tactile_node.pose.solids import pose_covariance, prism, solid
from tactile_node.shape.recognition import SHAPES, Shape
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import CLASSES, Contact, Purpose, generator, random_contact
from training.ground_truth.raster import coverage

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


# Outlines, coverage and models

def test_every_shape_has_an_outline():
    assert set(OUTLINES) == {shape.value for shape in SHAPES}


@pytest.mark.parametrize('contact', contacts(2), ids=lambda c: c.shape)
def test_outlines_are_those_of_the_synthetic_world(contact):
    corners = outline_of(Shape(contact.shape), contact.handedness).corners(parameters_of(contact))
    if contact.shape == 'circle':
        following = np.roll(corners, -1, axis=0)
        area = (corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]).sum() / 2
        assert area == pytest.approx(contact.area)
        return
    apart = np.linalg.norm(corners[:, None] - contact.outline()[None], axis=-1)
    assert apart.min(1).max() < 1e-12  # the same corners, wherever the list begins


def test_coverage_of_a_rectangle_along_the_lattice_by_hand():
    corners = np.array([[0.75, 0.0], [2.0, 0.0], [2.0, 1.0], [0.75, 1.0]])
    covered, _ = coverage(corners, np.zeros((1, 4, 2)), Window(0, 0, 3, 4))
    # taxel 1 is covered from x = 0.75 to 1.5, taxel 2 from 1.5 to 2; rows 0 and 1 by half each
    assert covered == pytest.approx(np.array([[0, .375, .25, 0], [0, .375, .25, 0], [0, 0, 0, 0]]))


@pytest.mark.parametrize('contact', contacts(2), ids=lambda c: c.shape)
def test_coverage_agrees_with_counting_points(contact):
    outline = outline_of(Shape(contact.shape), contact.handedness)
    covered, _ = coverage(*outline.moving(parameters_of(contact)), WINDOW)
    step = (np.arange(40) + 0.5) / 40 - 0.5
    y = (WINDOW.row + np.arange(WINDOW.rows))[:, None] + step
    x = (WINDOW.col + np.arange(WINDOW.cols))[:, None] + step
    x, y = np.meshgrid(x.ravel(), y.ravel())
    counted = (contact.depth(x, y) >= 0).reshape(WINDOW.rows, 40, WINDOW.cols, 40).mean((1, 3))
    assert np.abs(covered - counted).max() < 0.01
    assert covered.sum() == pytest.approx(contact.area)


def test_what_lies_left_of_the_window_is_cut_off_right():
    outline, window = OUTLINES[Shape.SQUARE], Window(0, 10, 20, 10)
    parameters = np.array([9.8, 9.3, 0.3, 7.0])
    whole, _ = coverage(*outline.moving(parameters), Window(0, 0, 20, 20))
    part, _ = coverage(*outline.moving(parameters), window)
    assert part == pytest.approx(whole[:, 10:])


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


@pytest.mark.parametrize('contact', contacts(2), ids=lambda c: c.shape)
def test_the_first_guess_is_near_without_any_fit(contact):
    shape = Shape(contact.shape)
    outline = outline_of(shape, contact.handedness)
    covered, _ = coverage(*outline.moving(parameters_of(contact)), Window(0, 0, 20, 20))
    y, x = np.indices(covered.shape).reshape(2, -1)
    guess = guesses(shape, moments_of(x, y, covered.ravel()), 0.0)[0]
    corners = outline_of(shape, guess.handedness).corners(guess.parameters)
    apart = np.linalg.norm(corners[:, None] - outline.corners(parameters_of(contact))[None], axis=-1)
    assert apart.min(1).max() < 0.4  # not exact: a taxel's value has no place within the taxel


# Fits

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


@pytest.mark.parametrize('contact', contacts(1), ids=lambda c: c.shape)
def test_on_off_patterns_are_fitted_too(contact):
    fit = fit_shape(contact.pattern(20, 20), contact.pattern(20, 20), Shape(contact.shape))
    assert np.hypot(fit.centre[0] - contact.x, fit.centre[1] - contact.y) < 0.5
    assert fit.dimensions == pytest.approx(contact.dimensions[:len(fit.dimensions)], rel=0.15)


def test_the_fit_moves_and_turns_with_the_frame():
    contact = contacts(1)[2]
    values = pressure_frame(contact, generator(Purpose.TEST, 1), 20, 20)
    mask = values > 15e3
    here = fit_shape(values, mask, Shape.RECTANGLE)
    moved = fit_shape(np.roll(values, (2, -1), (0, 1)), np.roll(mask, (2, -1), (0, 1)), Shape.RECTANGLE)
    assert np.subtract(moved.centre, here.centre) == pytest.approx([-1, 2], abs=1e-6)
    mirrored = fit_shape(values.T, mask.T, Shape.RECTANGLE)  # x and y change places
    assert mirrored.centre == pytest.approx(here.centre[::-1], abs=1e-3)
    assert angle_apart(mirrored.angle, np.pi / 2 - here.angle, 2) < 1e-3
    assert mirrored.dimensions == pytest.approx(here.dimensions, rel=1e-3)


def test_the_unit_does_not_matter_and_the_pitch_scales():
    contact = contacts(1)[4]
    values = pressure_frame(contact, generator(Purpose.TEST, 1), 20, 20, skin=Skin(noise=0.01))
    a = fit_shape(values, values > 15e3, Shape.ISOSCELES_TRIANGLE, 1.0)
    b = fit_shape(values / 1e5, values > 15e3, Shape.ISOSCELES_TRIANGLE, PITCH)
    assert np.multiply(a.dimensions, PITCH) == pytest.approx(b.dimensions)
    assert b.covariance[0, 0] == pytest.approx(a.covariance[0, 0] * PITCH**2, rel=1e-3)
    assert b.covariance[2, 2] == pytest.approx(a.covariance[2, 2], rel=1e-3)
    assert b.outline == pytest.approx(a.outline * PITCH)


def test_noise_makes_the_region_larger():
    contact, traces = contacts(1)[1], []
    for noise in (0.005, 0.02, 0.08):
        values = pressure_frame(contact, generator(Purpose.TEST, 3), 20, 20, skin=Skin(noise=noise))
        traces.append(np.trace(fit_shape(values, contact.pattern(20, 20), Shape.SQUARE).covariance[:2, :2]))
    assert traces[0] < traces[1] < traces[2]


def test_a_frame_with_a_hole_is_a_square_by_its_outline():
    outer = Contact('square', (9.0,), 10.2, 9.8, angle=0.4)
    inner = Contact('square', (4.0,), 10.2, 9.8, angle=0.4)
    rng = generator(Purpose.TEST, 4)
    values = pressure_frame(outer, rng, 20, 20) - pressure_frame(inner, rng, 20, 20)
    fit = fit_shape(values, values > 15e3, Shape.SQUARE)
    assert fit.dimensions[0] == pytest.approx(9.0, abs=0.1)
    assert fit.centre == pytest.approx((10.2, 9.8), abs=0.1)


def test_a_contact_over_the_pads_edge_is_completed():
    contact = Contact('rectangle', (10.0, 5.0), 3.0, 9.6, angle=0.3)  # two pitches of its length lie outside
    values = pressure_frame(contact, generator(Purpose.TEST, 4), 20, 20, skin=Skin(noise=0.005))
    fit = fit_shape(values, values > 15e3, Shape.RECTANGLE)
    assert fit.dimensions[1] == pytest.approx(5.0, abs=0.15)
    assert np.degrees(angle_apart(fit.angle, 0.3, 2)) < 2


def test_an_equilateral_triangle_has_no_certain_apex():
    contact = Contact('isosceles_triangle', (10.0, 5 * 3**0.5), 9.7, 10.1, angle=0.5)
    mask = contact.pattern(20, 20)
    fit = fit_shape(mask, mask, Shape.ISOSCELES_TRIANGLE)
    assert fit.symmetry == 3 and angle_apart(fit.angle, 0.5, 3) < np.radians(6)
    slim = Contact('isosceles_triangle', (7.0, 13.0), 9.7, 10.1, angle=0.5)
    values = pressure_frame(slim, generator(Purpose.TEST, 5), 20, 20)
    fit = fit_shape(values, values > 15e3, Shape.ISOSCELES_TRIANGLE)
    base, height = fit.dimensions
    assert fit.symmetry == 1 and 2 * np.arctan(base / 2 / height) == pytest.approx(2 * np.arctan(3.5 / 13), rel=0.02)


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


# Solids

def test_solids_and_pose_covariance():
    contact = contacts(1)[2]
    values = pressure_frame(contact, generator(Purpose.TEST, 1), 20, 20)
    fit = fit_shape(values, values > 15e3, Shape.RECTANGLE, PITCH)
    assert solid(fit, 0.01) == ('box', (*fit.dimensions, 0.01))
    covariance = pose_covariance(fit)
    assert covariance[0, 5] == fit.covariance[0, 2] and covariance[5, 5] == fit.covariance[2, 2]
    assert not covariance[2:5].any()


@pytest.mark.parametrize('contact', contacts(1), ids=lambda c: c.shape)
def test_a_prism_is_closed_and_has_the_volume_of_its_base(contact):
    values = pressure_frame(contact, generator(Purpose.TEST, 1), 20, 20)
    fit = fit_shape(values, values > 15e3, Shape(contact.shape))
    vertices, triangles = prism(fit, 3.0)
    corners = vertices[triangles]
    volume = np.einsum('ij,ij->i', corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    x, y = fit.outline.T
    base = (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2
    assert volume == pytest.approx(3 * base)  # positive: all triangles face outwards
    assert base == pytest.approx(contact.area, rel=0.04)
    edges = {(a, b) for t in triangles.tolist() for a, b in zip(t, t[1:] + t[:1])}
    assert len(edges) == 3 * len(triangles) and edges == {(b, a) for a, b in edges}
