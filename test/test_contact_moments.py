"""Force, centre of pressure, area and principal axis by hand."""

from math import pi

import numpy as np
import pytest

from tactile_node.errors import ConfigurationError, InputError
from tactile_node.pose.moments import contact_moments

PITCH = 0.002
VALUES = np.array([[0, 1000.0, 0], [0, 3000.0, 0], [0, 0, 500.0]])
MASK = VALUES > 600


def test_force_is_pressure_times_area_and_its_centre_its_mean():
    found = contact_moments(VALUES, MASK, PITCH, 'Pa')
    assert found.force == pytest.approx(4000 * 4e-6)
    assert found.centre_of_pressure == pytest.approx((1 * PITCH, 0.75 * PITCH))
    assert found.area == pytest.approx(2 * 4e-6)
    assert found.principal_axis == pytest.approx(pi / 2)


def test_newtons_are_summed_and_on_off_has_no_force():
    assert contact_moments(VALUES, MASK, PITCH, 'N').force == pytest.approx(4000)
    assert np.isnan(contact_moments(MASK, MASK, PITCH, '1').force)
    assert contact_moments(MASK, MASK, PITCH, '1').centre_of_pressure == pytest.approx((PITCH, 0.5 * PITCH))


def test_a_dead_taxel_counts_as_its_neighbours():
    values = np.full((5, 5), 100.0)
    values[2, 2] = values[0, 0] = np.nan
    found = contact_moments(values, np.ones((5, 5), bool), PITCH, 'N')
    assert found.force == pytest.approx(2500) and found.filled == 2
    assert found.centre_of_pressure == pytest.approx((2 * PITCH, 2 * PITCH))


def test_only_dead_taxels_have_no_centre():
    found = contact_moments(np.full((2, 2), np.nan), np.ones((2, 2), bool), PITCH, 'N')
    assert found.force == 0 and np.isnan(found.centre_of_pressure).all() and found.filled == 4


@pytest.mark.parametrize(('shape', 'expected'), [((3, 9), 0.0), ((9, 3), pi / 2)])
def test_the_axis_lies_along_the_long_side(shape, expected):
    mask = np.ones(shape, bool)
    assert contact_moments(mask, mask, PITCH, '1').principal_axis == pytest.approx(expected)


def test_the_axis_of_a_diagonal_and_none_of_a_square():
    diagonal = np.eye(5, dtype=bool)
    assert contact_moments(diagonal, diagonal, PITCH, '1').principal_axis == pytest.approx(pi / 4)
    assert np.isnan(contact_moments(np.ones((4, 4)), np.ones((4, 4), bool), PITCH, '1').principal_axis)


def test_an_empty_pad_has_no_force_and_no_centre():
    found = contact_moments(VALUES, np.zeros((3, 3), bool), PITCH, 'Pa')
    assert found.force == 0 and found.area == 0 and np.isnan(found.centre_of_pressure).all()


def test_wrong_input_is_refused():
    with pytest.raises(InputError):
        contact_moments(VALUES, MASK[:2], PITCH, 'Pa')
    with pytest.raises(ConfigurationError, match='unit'):
        contact_moments(VALUES, MASK, PITCH, 'kPa')
    with pytest.raises(ConfigurationError, match='pitch'):
        contact_moments(VALUES, MASK, 0.0, 'Pa')
