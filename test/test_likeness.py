"""How well a patch is covered by each shape laid over it by its moments."""

import numpy as np
import pytest

from tactile_node.shape.invariants import describe_all
from tactile_node.shape.likeness import COUNT
from tactile_node.shape.patch import SIDE
from tactile_node.synthetic.pressure import coverage
from tactile_node.synthetic.seeds import Purpose, generator
from tactile_node.synthetic.world import CLASSES, Contact, random_contact

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
