"""Check the layer of bench/elastic_layer.py against balances of force and moment, and against a half-space.

The balances hold for every layer, whatever its stiffness. A thick layer deforms like the half-space of Love, and a
punch that sticks to it resists like that of Mindlin. The unit of length is 1 mm.
"""

import numpy as np
import pytest
from elastic_layer import ElasticLayer
from stuck_contact import PitchJoint, stuck_response

from tactile_node.pose.motion import LARGEST_LOAD, SHIFT_OF_EXTENT
from training.ground_truth.half_space import displacement_influence

CELL = 0.25


def grid(count):
    line = (np.arange(count) - count // 2) * CELL
    return np.meshgrid(line, line)


def first_moment(x, pressure):
    return float((x * pressure).sum()) * CELL**2


def disc(radius, count, force=5.0):
    x, y = grid(count)
    pressure = np.where(np.hypot(x, y) < radius, 1.0, 0.0)
    return x, pressure * force / (pressure.sum() * CELL**2)


@pytest.mark.parametrize('poisson', [0.3, 0.49])
@pytest.mark.parametrize('thickness', [1.0, 2.0])
def test_the_base_carries_the_force_and_the_moment_of_the_load(thickness, poisson):
    """A load of 2 N along x acts at one thickness above the base, which must carry the moment."""
    x, pressure = disc(3.0, 256)
    shear = 0.4 * pressure
    layer = ElasticLayer(thickness, 0.3, poisson)
    base = layer.base_pressure(CELL, pressure, shear, 0 * shear)
    assert base.sum() * CELL**2 == pytest.approx(5.0, rel=1e-5)
    assert first_moment(x, base) == pytest.approx(thickness * 2.0, rel=2e-3)
    assert base.min() < 0  # The balance only holds for the field before it is clipped.


def test_a_constant_load_compresses_and_shears_the_whole_layer():
    one = np.ones((8, 8))
    moved = ElasticLayer(2.0, 0.5, 0.3).surface(CELL, one, one, 2 * one)
    oedometer = 2 * 0.5 * (1 - 0.3) / (1 - 2 * 0.3)
    np.testing.assert_allclose(moved.z, 2.0 / oedometer, rtol=1e-4)
    np.testing.assert_allclose(moved.x, 2.0 / 0.5, rtol=1e-4)
    np.testing.assert_allclose(moved.y, 2 * 2.0 / 0.5, rtol=1e-4)


def test_a_thick_layer_sinks_in_like_a_half_space():
    x, y = grid(256)
    pressure = np.exp(-(x**2 + y**2) / 4.5)
    none = np.zeros_like(pressure)
    modulus, poisson = 0.5, 0.3
    depth = ElasticLayer(60.0, modulus, poisson).surface(CELL, pressure, none, none).z
    expected = displacement_influence(pressure.shape, CELL)(pressure) * (1 - poisson) / (2 * modulus)
    centre, aside = (128, 128), (128, 140)
    assert depth[centre] - depth[aside] == pytest.approx(expected[centre] - expected[aside], rel=0.01)


def test_a_disc_that_sticks_to_a_thick_layer_resists_like_on_a_half_space():
    """Mindlin 1949: a disc of radius a moves by T (2 - ν) / (8 G a). Without compression, ν = 0.5, this is exact."""
    _, pressure = disc(2.0, 512)
    response = stuck_response(ElasticLayer(30.0, 0.2, 0.499), CELL, pressure, PitchJoint())
    radius = np.sqrt(np.count_nonzero(pressure) * CELL**2 / np.pi)
    assert response.displacement == pytest.approx(5.0 * (2 - 0.499) / (8 * 0.2 * radius), rel=0.03)
    assert response.tilt == 0.0


@pytest.mark.parametrize('poisson', [0.3, 0.45, 0.499])
@pytest.mark.parametrize('thickness', [0.5, 1.0, 2.5, 6.0])
def test_the_shift_is_at_most_the_allowed_share_of_the_extent(thickness, poisson):
    """A disc of 3 mm radius is shifted by the largest load, on thin and thick skins."""
    cell = 0.375
    line = (np.arange(161) - 80) * cell
    x, y = np.meshgrid(line, line)
    pressure = np.where(np.hypot(x, y) < 3.0, 1.0, 0.0)
    layer, none = ElasticLayer(thickness, 0.2, poisson), np.zeros_like(pressure)
    rest = layer.base_pressure(cell, pressure, none, none)
    loaded = rest + LARGEST_LOAD * stuck_response(layer, cell, pressure, PitchJoint()).base
    is_pressed, is_pressed_now = rest > 0.05 * rest.max(), loaded > 0.05 * loaded.max()
    extent = np.ptp(x[is_pressed]) + cell
    centre = (x * loaded)[is_pressed_now].sum() / loaded[is_pressed_now].sum()
    outline = x[is_pressed_now].mean()
    assert 0.02 * extent < min(centre, outline)
    assert max(centre, outline) < SHIFT_OF_EXTENT * extent


@pytest.mark.parametrize('stiffness', [np.inf, 1e4])
def test_the_moment_under_a_contact_that_sticks_is_that_of_the_joint(stiffness):
    """The normal force stays constant, and the joint takes the moment at the base and of the load at its arm."""
    x, pressure = disc(3.0, 256)
    layer, joint = ElasticLayer(2.0, 0.3, 0.45), PitchJoint(stiffness, arm=20.0)
    response = stuck_response(layer, CELL, pressure, joint)
    assert response.base.sum() * CELL**2 == pytest.approx(0.0, abs=1e-6)
    moment = first_moment(x, response.base) + 5.0 * 20.0
    assert response.tilt == pytest.approx(-moment / stiffness, rel=2e-3)
