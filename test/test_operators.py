"""Operators of the Helmholtz equation on a lattice, and their eigenvalues."""

import by_definition
import numpy as np
import pytest
from patterns import assorted, blob, rotated_patterns, shapes

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


@pytest.mark.parametrize('seed', range(6))
def test_the_extremes_alone_equal_the_extremes_of_all_eigenvalues(seed):
    mask = shapes(20 + 15 * seed)[seed % 5] if seed < 5 else blob(3)
    taxels = taxel_list(rotated_patterns(mask))
    rim = taxel_list(taxels.border(WEIGHTS[Stencil.NINE]))
    problems = [(chosen, k) for chosen in (taxels, rim) for k in Stencil]
    for every, some in zip(smallest_eigenvalues(problems), smallest_eigenvalues(problems, 2)):
        np.testing.assert_allclose(some[:2], every[:2], rtol=1e-9)
        assert np.nanmin(some[2:]) == pytest.approx(np.nanmin(every[2:]), rel=1e-9)
        assert np.nanmax(some[2:]) == pytest.approx(np.nanmax(every[2:]), rel=1e-9)


def membrane(name, size):
    """Return the mask of a shape that is ``size`` lattice steps wide, and the shape's membrane eigenvalue.

    The lattice points on the outline lie outside the mask.
    """
    y, x = np.indices((size + 2, size + 2)).astype(float)
    if name == 'right isosceles triangle':
        return (x > 0) & (y > 0) & (x + y < size), 5 * np.pi ** 2
    if name == 'equilateral triangle':
        y -= 0.5  # The base lies half-way between two rows of lattice points.
        return (y > 0) & (y < np.sqrt(3) * np.minimum(x, size - x)), 16 * np.pi ** 2 / 3
    radius = np.hypot(x - size / 2 - 0.5, y - size / 2 - 0.5)
    return radius < size / 2, (2 * 2.404825557695773) ** 2


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
