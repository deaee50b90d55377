"""Section 2: matrices, numbering, borders."""

import by_definition
import numpy as np
import pytest
from patterns import L_OF_THREE, assorted, ring

from tactile_node.helmholtz.operators import Stencil, border, matrix, row_sums


@pytest.mark.parametrize('name', assorted())
@pytest.mark.parametrize('stencil', Stencil)
def test_matrix_is_that_of_the_definition(name, stencil):
    mask = assorted()[name]
    points = by_definition.taxels(mask)
    dense = by_definition.dense(points, stencil)
    np.testing.assert_allclose(matrix(mask, stencil).toarray(), dense, atol=1e-15)
    np.testing.assert_allclose(row_sums(mask, stencil), dense.sum(1), atol=1e-14)
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
