"""What taxels read at rest, by one frame."""

import numpy as np
import pytest

from tactile_node.contact.resting import resting_of


def test_level_and_noise_are_those_of_the_resting_taxels():
    rng = np.random.default_rng(1)
    values = 2.0 * rng.standard_normal((32, 32)) + 7
    values[3:27, 3:27] = 1000  # more than half of the pad
    found = resting_of(values)
    assert (found.level, found.deviation) == (pytest.approx(7.0, abs=0.4), pytest.approx(2.0, rel=0.1))
    values[28, :5] = 300
    assert resting_of(values).deviation == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize('covered', [0.0, 0.3, 0.5, 0.7])
@pytest.mark.parametrize('height', [8.0, 30.0, 1000.0])
def test_a_contact_of_whatever_height_may_cover_three_quarters_less_a_little(covered, height):
    rng = np.random.default_rng(7)
    found = []
    for _ in range(50):
        values = rng.standard_normal(256)
        values[:int(covered * 256)] += height
        found.append(resting_of(values))
    levels, deviations = np.array(found).T
    assert abs(np.median(levels)) < 0.2 and np.abs(levels).max() < 1
    assert 0.8 < np.median(deviations) < 1.2 and (0.5 < deviations).all() and (deviations < 2).all()


def test_noise_below_the_resolution_is_not_seen():
    counts = np.zeros(256)
    counts[::10] = 4.0
    assert resting_of(counts) == resting_of(np.zeros(256)) == (0.0, 0.0)


def test_a_few_taxels_show_nothing():
    assert not resting_of(np.arange(7.0)).is_known and resting_of(np.arange(8.0)).is_known


@pytest.mark.parametrize('taxels', [1, 5, 20, 31])
@pytest.mark.parametrize('below', [30.0, 1e3, 1e6])
def test_a_few_taxels_far_below_the_others_hide_no_contact(taxels, below):
    """As of taxels that lost their offset: with them as noise, nothing would be pressed, and a held object be lost."""
    rng = np.random.default_rng(8)
    for covered in (0, 30, 120):
        values = rng.standard_normal(256)
        values[:taxels] -= below
        values[256 - covered:] += 20
        found = resting_of(values)
        assert abs(found.level) < 0.6 and 0.6 < found.deviation < 1.6
    counts = np.full(256, 1000)
    counts[:taxels] = 0
    assert resting_of(counts.astype(float)) == (1000, 0)


@pytest.mark.parametrize('size', [64, 256, 4096])
@pytest.mark.parametrize('step', [0.0, 0.25, 0.5, 1.0, 1.5])
def test_noise_in_whole_steps_and_on_small_pads_is_found(size, step):
    """Rounding adds a twelfth of the square of the step to the variance (Sheppard)."""
    rng, found = np.random.default_rng(9), []
    for _ in range(200):
        values = rng.standard_normal(size)
        found.append(resting_of(np.rint(values / step) * step if step else values))
    levels, deviations = np.array(found).T
    assert np.median(deviations) == pytest.approx((1 + step ** 2 / 12) ** 0.5, rel=0.12)
    assert abs(np.median(levels)) < 0.15
