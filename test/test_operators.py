"""Operators of the Helmholtz equation on a lattice, and their eigenvalues."""

import by_definition
import numpy as np
import pytest
from patterns import L_OF_THREE, assorted, blob, ring, rotated_patterns, shapes

from bench.reproduction.matrices import border, matrix
from tactile_node.helmholtz.eigenvalues import smallest_eigenvalues
from tactile_node.helmholtz.taxel_list import WEIGHTS, Stencil, taxel_list


def smallest(mask, stencil):
    return smallest_eigenvalues([(taxel_list(mask[np.newaxis]), stencil)])[0][0]


@pytest.mark.parametrize('rows, cols', [(1, 1), (1, 2), (1, 40), (40, 1), (2, 2), (3, 3), (5, 9), (16, 16),
                                        (60, 50), (90, 100)])
def test_rectangles_have_their_closed_form(rows, cols):
    a, b = np.cos(np.pi / (rows + 1)), np.cos(np.pi / (cols + 1))
    mask = np.ones((rows, cols), bool)
    assert smallest(mask, Stencil.FIVE) == pytest.approx(4 - 2 * a - 2 * b, rel=1e-9)
    assert smallest(mask, Stencil.NINE) == pytest.approx((20 - 8 * (a + b) - 4 * a * b) / 6, rel=1e-9)


@pytest.mark.parametrize('stencil', Stencil)
def test_dense_solver_agrees(stencil):
    for name, mask in (assorted() | {f'blob {seed}': blob(seed) for seed in range(30)}).items():
        dense = np.linalg.eigvalsh(by_definition.dense(by_definition.taxels(mask), stencil))[0]
        assert smallest(mask, stencil) == pytest.approx(dense, rel=1e-9), name


@pytest.mark.parametrize('gap', [0, 1, 2])
@pytest.mark.parametrize('stencil', Stencil)
def test_nearly_equal_eigenvalues_of_weakly_joined_squares(gap, stencil):
    """Two 8×8 squares, one perhaps short of a corner, joined by a thread: a double eigenvalue or nearly."""
    mask = np.zeros((8, 20), bool)
    mask[:, :8] = mask[:, 12:] = True
    mask[0, 0] = gap != 1
    mask[4, 8:12] = gap == 2
    dense = np.linalg.eigvalsh(matrix(mask, stencil).toarray())[0]
    assert smallest(mask, stencil) == pytest.approx(dense, rel=1e-9)


def test_parts_far_apart_have_the_smaller_of_their_eigenvalues():
    mask = np.zeros((10, 12), bool)
    mask[:3, :3] = mask[5:, 5:] = True
    assert smallest(mask, Stencil.FIVE) == pytest.approx(smallest(mask[5:, 5:], Stencil.FIVE), rel=1e-12)


def test_empty_patterns_among_others_are_undefined():
    stack = np.zeros((4, 3, 3), bool)
    stack[1], stack[3, 1, 1] = True, True
    five, nine = smallest_eigenvalues([(taxel_list(stack), k) for k in Stencil])
    np.testing.assert_allclose(five, [np.nan, 4 - 2 * np.sqrt(2), np.nan, 4], rtol=1e-9)
    np.testing.assert_allclose(nine, [np.nan, (18 - 8 * np.sqrt(2)) / 6, np.nan, 20 / 6], rtol=1e-9)


def test_eigenvalue_falls_when_the_pattern_grows():
    for stencil in Stencil:
        for mask in [ring(), *shapes(40)]:
            smaller = mask.copy()
            smaller[tuple(np.argwhere(mask)[-1])] = False
            assert smallest(mask, stencil) < smallest(smaller, stencil)


@pytest.mark.parametrize('seed', range(6))
def test_only_extremes_are_those_of_all(seed):
    mask = shapes(20 + 15 * seed)[seed % 5] if seed < 5 else blob(3)
    taxels = taxel_list(rotated_patterns(mask))
    rim = taxel_list(taxels.border(WEIGHTS[Stencil.NINE]))
    problems = [(chosen, k) for chosen in (taxels, rim) for k in Stencil]
    for every, some in zip(smallest_eigenvalues(problems), smallest_eigenvalues(problems, 2)):
        np.testing.assert_allclose(some[:2], every[:2], rtol=1e-9)
        assert np.nanmin(some[2:]) == pytest.approx(np.nanmin(every[2:]), rel=1e-9)
        assert np.nanmax(some[2:]) == pytest.approx(np.nanmax(every[2:]), rel=1e-9)


def membrane(name, size):
    """Mask of a shape of ``size`` steps, its outline's lattice points outside; its membrane eigenvalue."""
    y, x = np.indices((size + 2, size + 2)).astype(float)
    if name == 'right isosceles triangle':
        return (x > 0) & (y > 0) & (x + y < size), 5 * np.pi ** 2
    if name == 'equilateral triangle':
        y -= 0.5  # the base between two rows: no row is nearer to the outline than the others
        return (y > 0) & (y < np.sqrt(3) * np.minimum(x, size - x)), 16 * np.pi ** 2 / 3
    radius = np.hypot(x - size / 2 - 0.5, y - size / 2 - 0.5)
    return radius < size / 2, (2 * 2.404825557695773) ** 2


def test_right_isosceles_triangle_converges_with_second_order():
    """Its outline runs through lattice points, so the five-point stencil's own order 2 shows.

    (The nine-point stencil reaches across the hypotenuse, where it should see -Φ and not 0: order 1.)
    """
    errors = [abs(smallest(mask, Stencil.FIVE) * size ** 2 / exact - 1)
              for size in (16, 32, 64) for mask, exact in [membrane('right isosceles triangle', size)]]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2, atol=0.1)


@pytest.mark.parametrize('name, stencil', [
    ('disc', Stencil.FIVE), ('disc', Stencil.NINE), ('right isosceles triangle', Stencil.NINE),
    ('equilateral triangle', Stencil.FIVE), ('equilateral triangle', Stencil.NINE)])
def test_other_outlines_converge_with_first_order(name, stencil):
    """An outline between lattice points is misplaced by up to a step: order 1, not smoothly."""
    sizes = np.array([12, 24, 48, 96])
    errors = [abs(smallest(mask, stencil) * size ** 2 / exact - 1)
              for size in sizes for mask, exact in [membrane(name, size)]]
    order = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert 0.7 < order < 2.1 and errors[-1] < 0.04, (order, errors)


@pytest.mark.parametrize('name', assorted())
@pytest.mark.parametrize('stencil', Stencil)
def test_matrix_is_that_of_the_definition(name, stencil):
    mask = assorted()[name]
    points = by_definition.taxels(mask)
    dense = by_definition.dense(points, stencil)
    np.testing.assert_allclose(matrix(mask, stencil).toarray(), dense, atol=1e-15)
    sums = taxel_list(mask[np.newaxis]).row_sums(WEIGHTS[stencil]) / WEIGHTS[stencil].denominator
    np.testing.assert_allclose(sums, dense.sum(1), atol=1e-14)
    assert [tuple(p) for p in np.argwhere(border(mask, stencil))] == by_definition.border(points, stencil)


def test_nine_point_matrix_of_three_taxels():
    """Numbered (0,0), (1,0), (1,1): 1-2 and 2-3 share an edge, 1-3 a corner."""
    expected = np.array([[20, -4, -1], [-4, 20, -4], [-1, -4, 20]]) / 6
    np.testing.assert_allclose(matrix(L_OF_THREE, Stencil.NINE).toarray(), expected, rtol=1e-15)


def test_five_point_matrix_stores_no_zeros():
    assert matrix(np.ones((3, 3), bool), Stencil.FIVE).nnz == 9 + 2 * 12


def test_border_of_a_full_square_is_its_rim():
    rim = np.ones((4, 4), bool)
    rim[1:3, 1:3] = False
    for stencil in Stencil:
        np.testing.assert_array_equal(border(np.ones((4, 4), bool), stencil), rim)


def test_nine_point_border_is_the_wider_one():
    mask = ring(20, 0.0, 8.0)
    five, nine = border(mask, Stencil.FIVE), border(mask, Stencil.NINE)
    assert (five <= nine).all() and nine.sum() > five.sum()
