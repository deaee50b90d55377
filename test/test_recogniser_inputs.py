"""What the recogniser is given: odd contacts, and how well each shape covers a patch."""

import numpy as np
import pytest

from tactile_node import Recogniser, find_contact, fit_shape
from tactile_node.contact.pattern import of_contact
from tactile_node.shape.invariants import describe_all
from tactile_node.shape.likeness import COUNT
from tactile_node.shape.patch import HIGHEST_LEVEL, SIDE, joined, make_patch
from tactile_node.shape.recognition import Shape, UnknownReason
from tactile_node.simulator.figures import coverage
from tactile_node.simulator.world import CLASSES, Contact, Purpose, generator, random_contact


@pytest.fixture(scope='module')
def recogniser():
    return Recogniser()


@pytest.mark.parametrize('rows', [3, 4, 5])
def test_hidden_rows_within_one_contact_take_no_piece_of_it_because_of_another_contact(recogniser, rows):
    values = np.zeros((20, 30))
    values[3:15, 5:11] = 50e3
    values[7:7 + rows] = np.nan
    alone = find_contact(values)
    values[15:19, 20:24] = 50e3
    beside = find_contact(values)
    assert (joined(beside) == joined(alone)).all() and (joined(beside) >= beside.mask).all()
    assert recogniser.recognise(beside).shape is recogniser.recognise(alone).shape


@pytest.mark.parametrize('sent', [-32768.0, -1e9])
def test_what_one_broken_taxel_sends_below_zero_changes_no_shape(recogniser, sent):
    values = np.random.default_rng(1).normal(0, 2, (20, 20)) * 100
    values[5:14, 5:14] += 30e3
    whole = recogniser.recognise(find_contact(values))
    values[8, 8] = sent
    found = recogniser.recognise(find_contact(values))
    assert whole.shape is found.shape is Shape.SQUARE and found.confidence > 0.9


def test_levels_stay_within_what_training_keeps():
    values = np.full((12, 12), 0.0)
    values[3:9, 3:9] = 10e3
    values[5, 5] = 90e3
    level = make_patch(values, values > 5e3).level
    assert level.max() == pytest.approx(HIGHEST_LEVEL) and level.min() >= 0


@pytest.mark.parametrize('baseline', [-1000, 300, 4000])
def test_an_array_without_a_unit_may_have_a_baseline(recogniser, baseline):
    """Counts of a converter that nothing has been taken off."""
    counts = np.rint(np.random.default_rng(2).normal(0, 1, (16, 24)))
    counts[5:10, 6:15] += 100
    plain, raised = (find_contact(counts + rest, unit=None) for rest in (0, baseline))
    assert recogniser.recognise(plain).shape is recogniser.recognise(raised).shape is Shape.RECTANGLE
    lengths = [fit_shape(contact, Shape.RECTANGLE).dimensions for contact in (plain, raised)]
    assert lengths[1] == pytest.approx(lengths[0], abs=0.1)


def test_the_largest_contact_is_no_specks_around_the_second(recogniser):
    triangle = np.zeros((24, 24))
    for row in range(4):
        triangle[14 + row, 3:7 - row] = 1
    beside = triangle.copy()
    beside[3:11, 12:20] = 1
    alone = recogniser.recognise(find_contact(triangle, unit='1'))
    second = of_contact(find_contact(beside, unit='1'), 2)
    assert recogniser.recognise(second._replace(contacts=1)).shape is alone.shape is not Shape.UNKNOWN


def test_specks_between_hidden_rows_are_not_seen_instead_of_unfamiliar(recogniser):
    values = np.zeros((16, 16))
    values[3:10, 4:11] = 50e3
    values[3:7] = values[8:12] = np.nan
    found = recogniser.recognise(find_contact(values))
    assert (found.shape, found.reason) == (Shape.UNKNOWN, UnknownReason.NOT_SEEN)


FIGURES = ('rectangle', 'square', 'triangle', 'circle')  #: whose overlap the first numbers are
OF_CLASS = dict(zip(CLASSES, ('circle', 'square', 'rectangle', 'triangle', 'triangle')))

ALSO = {'square': ('rectangle',)}  #: of a class


def numbers_of(levels: np.ndarray) -> np.ndarray:
    """Of covered fractions (K, SIDE, SIDE)."""
    return describe_all(levels, np.zeros(levels.shape), np.ones(len(levels)))[:, -COUNT:]


@pytest.mark.parametrize('shape', CLASSES)
def test_a_shape_is_covered_by_its_own_figure(shape):
    rng = generator(Purpose.TEST, 21)
    covered = np.array([coverage(random_contact(rng, shape, 60, SIDE, SIDE), SIDE, SIDE) for _ in range(20)])
    overlaps = numbers_of(covered)[:, :4]
    own = FIGURES.index(OF_CLASS[shape])
    others = [k for k, figure in enumerate(FIGURES) if figure not in (OF_CLASS[shape], *ALSO.get(shape, ()))]
    assert (overlaps[:, own] > 0.9).all()
    assert (overlaps[:, others].max(1) < 0.85).all()


def test_overlap_is_that_of_areas():
    """Of a square and the circle of the same area, found by counting points."""
    side = 12.0
    points = (np.arange(2000) + 0.5) / 2000 * 2 * side - side
    x, y = np.meshgrid(points, points)
    in_square, in_circle = np.maximum(np.abs(x), np.abs(y)) <= side / 2, np.hypot(x, y) <= side / np.pi ** 0.5
    expected = (in_square & in_circle).sum() / (in_square | in_circle).sum()
    square = coverage(Contact('square', (side,), x=9.5, y=9.5), SIDE, SIDE)
    assert numbers_of(square[None])[0, FIGURES.index('circle')] == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize('turned', [lambda a: a[:, ::-1], lambda a: a[:, :, ::-1], lambda a: a.swapaxes(1, 2)])
def test_numbers_are_those_of_the_mirrored_patch(turned):
    rng = generator(Purpose.TEST, 22)
    covered = np.array([coverage(random_contact(rng, shape, 50, SIDE, SIDE), SIDE, SIDE) for shape in CLASSES[2:]])
    np.testing.assert_allclose(numbers_of(np.ascontiguousarray(turned(covered))), numbers_of(covered), atol=2e-3)


def test_what_is_none_of_the_shapes_is_like_none():
    cross = np.zeros((1, SIDE, SIDE))
    cross[0, 8:12, 2:18] = cross[0, 2:18, 8:12] = 1
    assert numbers_of(cross)[0, :4].max() < 0.75


def test_a_line_of_taxels_has_finite_numbers():
    line = np.zeros((2, SIDE, SIDE))
    line[0, 10, 3:15] = line[1, 10, 10] = 1
    assert np.isfinite(numbers_of(line)).all()
