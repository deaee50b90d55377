"""Tests for the averages over blocks of taxels and for the pressure kernel of an elastic layer."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.pose.evidence import BLOCKS_AROUND, MOST_BLOCKS, in_blocks, size_of
from tactile_node.pose.fit import fit_shape
from tactile_node.pose.skin_model import KERNEL_DEPTHS, KERNEL_REACH, kernel, taps_at
from tactile_node.shape.recognition import Shape
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import CLASSES, random_contact
from training.ground_truth.seeds import Purpose, generator


@pytest.mark.parametrize(('extent', 'size'), [(1, 1), (32, 1), (33, 2), (64, 2), (65, 3), (1024, 32)])
def test_no_contact_is_wider_than_so_many_blocks(extent, size):
    assert size_of(np.ones((extent, 3), bool)) == size_of(np.ones((3, extent), bool)) == size


def test_blocks_are_means_of_what_is_seen_and_lie_in_the_middle_of_their_taxels():
    values, mask = np.arange(40.0 * 30).reshape(40, 30), np.zeros((40, 30), bool)
    mask[10:20, 9:14] = True
    # One taxel of block (0, 0) and all taxels of block (1, 1) have no value.
    values[4, 3], values[6:8, 5:7] = np.nan, np.nan
    values[8, 4:6] = np.nan  # One taxel in each of the blocks (2, 0) and (2, 1) has no value.
    means, of_contact, corner = in_blocks(values, mask, 2)
    # The blocks begin three blocks before the first taxel of the contact, which is (10, 9).
    assert corner == (3.5, 4.5)
    assert means.shape == of_contact.shape == (11, 9)
    assert means[0, 0] == pytest.approx(np.mean([values[4, 4], values[5, 3], values[5, 4]]))
    assert np.isnan(means[1, 1]) and np.isfinite(means[2, :2]).all()
    assert means[3, 3] == pytest.approx(values[10:12, 9:11].mean())
    assert of_contact[3:8, 3:5].all() and of_contact[3:8, 5].all() and of_contact.sum() == 15


def test_blocks_that_the_edge_of_the_pad_cuts_have_no_value():
    values, mask = np.ones((35, 35)), np.zeros((35, 35), bool)
    mask[2:, 1:] = True
    means, _, corner = in_blocks(values, mask, 2)
    assert corner == (0.5, 0.5)
    assert np.isnan(means[-1]).all() and np.isnan(means[:, -1]).all()
    assert np.isfinite(means[:-1, :-1]).all()


@pytest.mark.parametrize('pad', [64, 256, 1024])
def test_the_number_of_blocks_in_a_fit_is_limited(pad):
    y, x = np.indices((pad, pad))
    mask = np.hypot(x - pad / 2, y - pad / 2) < 0.45 * pad
    means, _, _ = in_blocks(mask.astype(float), mask, size_of(mask))
    assert max(means.shape) <= MOST_BLOCKS + 2 * BLOCKS_AROUND + 1


@pytest.mark.parametrize('shape', CLASSES)
@pytest.mark.parametrize('is_on_off', [False, True])
@pytest.mark.parametrize('area', [1100.0, 4000.0])
def test_a_large_contact_has_the_right_place_and_size(shape, is_on_off, area):
    rng, pitch, side = generator(Purpose.TEST, 41), 0.002, 140
    contact = random_contact(rng, shape, area, rows=side, cols=side)
    if is_on_off:
        values = mask = contact.pattern(side, side)
    else:
        values = pressure_frame(contact, rng, side, side, skin=Skin(noise=0.01, blur=0.5, dead=0.03))
        mask = PatternExtractor(unit='Pa').extract(values).mask
    assert size_of(mask) > 1
    fit = fit_shape(values, mask, Shape(shape), pitch)
    centre = contact.outline().mean(0) if 'triangle' in shape else np.array((contact.x, contact.y))
    assert np.hypot(*(np.array(fit.centre) / pitch - centre)) < 0.15
    lengths = np.sort(contact.dimensions[:len(fit.dimensions)]) * pitch
    assert np.sort(fit.dimensions) == pytest.approx(lengths, rel=0.008)
    distance = np.linalg.norm(fit.outline[:, None] / pitch - contact.outline()[None], axis=-1)
    assert shape == 'circle' or distance.min(1).max() < 0.6  # A circle has no corners to compare.


def test_a_large_contact_over_the_edge_of_the_pad_is_completed():
    rng = generator(Purpose.TEST, 42)
    contact = random_contact(rng, 'circle', 2000.0, rows=100, cols=100)
    values = pressure_frame(contact, rng, 100, 100, skin=Skin(noise=0.01, blur=0.5))[:, 33:]
    fit = fit_shape(values, PatternExtractor(unit='Pa').extract(values).mask, Shape.CIRCLE)
    assert np.hypot(fit.centre[0] + 33 - contact.x, fit.centre[1] - contact.y) < 0.3
    assert fit.dimensions[0] == pytest.approx(contact.dimensions[0], rel=0.01)


def test_a_line_that_no_block_is_half_full_of_is_fitted_in_taxels():
    mask = np.zeros((80, 80), bool)
    mask[40, 5:75] = True
    fit = fit_shape(mask, mask, Shape.RECTANGLE)
    assert fit.dimensions[0] == pytest.approx(70, abs=2) and np.isfinite(fit.covariance).all()


@pytest.mark.parametrize('depth', [0.3, 1.0, 2.0])
def test_far_away_a_pressed_taxel_is_a_point_force(depth):
    """The expected value is Boussinesq's formula for a point force: 3 z^3 / (2 pi (r^2 + z^2)^(5/2)).

    The formula holds for small taxels. The kernel averages over the areas of both taxels and is therefore 6 % larger.
    """
    far, z = 6.0, depth
    assert kernel(depth)[KERNEL_REACH, KERNEL_REACH + 6] == pytest.approx(
        3 * z ** 3 / (2 * np.pi * (far ** 2 + z ** 2) ** 2.5), rel=0.07)


def test_a_taxel_under_itself_feels_the_integral_over_both_squares():
    def under(y, x):
        """Return the pressure at the point (x, y) under the taxel, integrated over the pressed area."""
        return dblquad(lambda v, u: 3 * 0.5 ** 3 / (2 * np.pi * ((u - x) ** 2 + (v - y) ** 2 + 0.25) ** 2.5),
                       -0.5, 0.5, -0.5, 0.5, epsabs=1e-6)[0]
    points = (np.arange(6) + 0.5) / 6 - 0.5
    mean = np.mean([under(y, x) for x in points for y in points])
    assert kernel(0.5)[KERNEL_REACH, KERNEL_REACH] == pytest.approx(mean, abs=1e-4)


def test_a_wide_pressure_passes_through():
    """The layer preserves the total force, except for the part that spreads beyond the reach of the kernel."""
    assert kernel(0.3).sum() == pytest.approx(1, abs=0.01)
    assert kernel(1.0).sum() == pytest.approx(1, abs=0.04)


@pytest.mark.parametrize('depth', np.geomspace(KERNEL_DEPTHS[0] * 1.05, KERNEL_DEPTHS[1] * 0.95, 9))
def test_two_products_are_the_kernel(depth):
    signs, taps, _ = taps_at(np.log(depth))
    apart = np.abs(np.arange(-KERNEL_REACH, KERNEL_REACH + 1))
    found = sum(sign * np.outer(tap[apart], tap[apart]) for sign, tap in zip(signs[:, 0], taps))
    assert found == pytest.approx(kernel(depth), abs=0.004)
