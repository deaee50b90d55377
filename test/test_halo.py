"""A cover over the skin may spread a load to neighbouring taxels.

The contact must end at the edge of the load itself, and not at the edge of the spread load.
"""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.signal import convolve2d

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.standing_out import halo_of

EVERYWHERE = np.ones((12, 18), bool)
BLOCK = np.zeros((12, 18), bool)
BLOCK[3:9, 6:12] = True


def carried(load, share, reach=3.0):
    """Return the load that the cover spreads to other taxels.

    The spread fraction ``share`` falls off with the cube of the distance. The code under test uses another profile.
    """
    y, x = np.mgrid[-12:13, -12:13]
    profile = (1 + (y * y + x * x) / reach ** 2) ** -1.5
    return share * convolve2d(load, profile / profile.sum(), 'same')


def quiet(shape):
    """Return the values of a pad at rest, which are close to 0.

    With exact zeros, the pad could be taken for an on/off pad.
    """
    frame = np.zeros(shape)
    frame[0, 0] = 1e-4
    frame[3, 3] = 2e-4
    return frame


@pytest.mark.parametrize('before', [[], [quiet(BLOCK.shape)], [np.zeros(BLOCK.shape)]], ids=['none', 'quiet', 'zeros'])
@pytest.mark.parametrize('share', [0.5, 1.5])
def test_a_block_keeps_its_size_under_uneven_gains_after_any_earlier_contact(before, share):
    for seed in range(20):
        gains = np.random.default_rng(seed).uniform(0.8, 1.25, BLOCK.shape)
        frame = 0.02 + gains * (BLOCK + carried(BLOCK, share))
        extractor = PatternExtractor()
        for rest in before:
            extractor.extract(rest)
        np.testing.assert_array_equal(extractor.extract(frame).mask, BLOCK, f'seed {seed}')


def test_a_block_keeps_its_outline_although_the_taxels_around_it_rested_lower_before():
    """While the block presses, the other taxels read 15 % of its level on average, each a different share."""
    block = BLOCK[2:10, 1:17]
    wrong = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        gains = np.exp(0.3 * rng.standard_normal(block.shape))
        beside = np.abs(gaussian_filter(rng.standard_normal(block.shape), 0.8))
        extractor = PatternExtractor()
        extractor.extract(quiet(block.shape))
        frame = gains * (block + carried(block, 1.0)) + 0.15 * beside / beside.mean()
        wrong.append(np.count_nonzero(extractor.extract(frame).mask ^ block))
    assert np.mean(wrong) < 1


def test_a_taxel_at_full_scale_does_not_hide_an_object_that_covers_the_pad():
    rng, extractor = np.random.default_rng(1), PatternExtractor()
    noise = 0.002 * rng.standard_normal((6, *BLOCK.shape))
    noise[:, 4, 4] = 1.0
    for frame in noise[:5]:
        extractor.extract(frame)
    assert extractor.extract(np.minimum(noise[5] + 0.24, 1.0)).mask.mean() > 0.5


def test_the_outline_of_a_dome_that_covers_the_pad_stays_near_half_of_its_peak():
    """The dome falls to 15 % at the middle of an edge, and to a half at 4.8 taxels from the middle of the pad."""
    rng, extractor = np.random.default_rng(0), PatternExtractor()
    y, x = (np.indices((16, 16)) - 7.5) / 8
    dome = np.exp(0.15 * rng.standard_normal(x.shape)) * 0.15 ** (x * x + y * y)
    for load in (*np.zeros(40), *np.linspace(0.05, 1, 20)):
        pattern = extractor.extract(load * dome + 0.003 * rng.standard_normal(dome.shape))
    assert np.count_nonzero(pattern.mask) > 0.7 * np.pi * 4.8 ** 2


def test_a_third_of_the_halo_or_more_is_taken_from_values_without_a_unit_and_none_from_pressures():
    halo = carried(BLOCK, 1.5)
    frame = BLOCK + halo
    beside = np.pad(BLOCK, 1)[1:-1, 2:] & ~BLOCK
    taken = (frame - PatternExtractor().extract(frame).values)[beside] / halo[beside]
    assert taken.min() > 1 / 3
    assert taken.max() < 1
    pressures = PatternExtractor(unit='Pa').extract(1e5 * frame)
    np.testing.assert_array_equal(pressures.values, 1e5 * frame)
    np.testing.assert_array_equal(pressures.mask, BLOCK)


def test_a_weak_side_is_not_a_halo():
    tilted = np.where(BLOCK, 1.0, 0.0)
    tilted[3:9, 12:15] = 0.3
    assert halo_of(tilted, EVERYWHERE, BLOCK) is None
    around = np.where(BLOCK, 1.0, 0.3)
    assert halo_of(around, EVERYWHERE, BLOCK) is not None


def test_too_few_taxels_around_a_contact_show_no_halo():
    small = np.ones((4, 4), bool)
    small[3, 3] = False
    assert halo_of(np.where(small, 1.0, 0.3), np.ones((4, 4), bool), small) is None
    assert halo_of(np.zeros((4, 4)), small, np.zeros((4, 4), bool)) is None
