"""What stands out of the noise, and where a contact ends."""

import warnings
from math import erf

import numpy as np
import pytest

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.standing_out import Threshold, standing_out

SIDE = 16
ROWS, COLS = np.mgrid[:SIDE, :SIDE]
NOWHERE = np.zeros((SIDE, SIDE), bool)
EVERYWHERE = ~NOWHERE
FLOOR = Threshold(0.0, np.ones((SIDE, SIDE)), 0.0)
PHI = np.vectorize(lambda x: (1 + erf(x / 2 ** 0.5)) / 2)  #: an edge blurred by a normal distribution


def box(row, col, rows, cols):
    return (ROWS >= row) & (ROWS < row + rows) & (COLS >= col) & (COLS < col + cols)


def flat(row, col, rows, cols, blur=0.6):
    """Indenter of level 1 with blurred edges: half of the level is exactly at its edges, in closed form."""
    def along(place, first, length):
        return PHI((place - first) / blur) - PHI((place - first - length) / blur)
    return along(ROWS, row, rows) * along(COLS, col, cols)


def found(values, threshold=FLOOR, before=NOWHERE):
    return standing_out(values, np.isfinite(values), threshold, before)


def far_from_the_edge(row, col, rows, cols, by):
    """Taxels farther than ``by`` from the outline and from its corners, where less than half is expected."""
    down, along = np.minimum(ROWS - row, row + rows - ROWS), np.minimum(COLS - col, col + cols - COLS)
    is_corner = (abs(down) < 1) & (abs(along) < 1)
    return (abs(down) > by) & (abs(along) > by) & ~is_corner, (down > 0) & (along > 0)


@pytest.mark.parametrize('tilt', [0.0, 0.3, 0.6])
@pytest.mark.parametrize('height', [20.0, 100.0, 1e5])
def test_the_outline_is_at_half_of_the_local_level_under_tilt(height, tilt):
    """``tilt``: the level rises by so much of its mean from one side to the other, about the middle."""
    rng = np.random.default_rng(1)
    for _ in range(40):
        row, col = rng.uniform(2, 5, 2)
        rows, cols = rng.uniform(5, 9, 2)
        level = height * (1 + tilt * (COLS - col - cols / 2) / cols)
        pressed = found(level * flat(row, col, rows, cols))
        is_clear, inside = far_from_the_edge(row, col, rows, cols, 0.3)
        np.testing.assert_array_equal(pressed[is_clear], inside[is_clear])


def test_of_a_contact_with_a_hard_edge_all_taxels_are_pressed_and_no_others():
    rng = np.random.default_rng(2)
    for rows, cols in ((2, 2), (4, 7), (12, 12), (1, 9), (16, 9)):  # up to 56 % of the pad
        mask = box(2 if rows < 16 else 0, 2, rows, cols)
        pattern = PatternExtractor().extract(20.0 * mask + rng.standard_normal(mask.shape))
        np.testing.assert_array_equal(pattern.labels == 1, mask)


def test_a_weak_taxel_between_stays_pressed_a_little_longer():
    values, mask = 100.0 * box(4, 4, 6, 6), box(4, 4, 6, 6)
    for level, first, held in ((18.0, False, True), (24.0, True, True), (15.0, False, False)):
        values[6, 6] = level
        assert found(values)[6, 6] == first and found(values, before=mask)[6, 6] == held


def test_what_is_pressed_stays_so_a_little_longer():
    values = 100.0 * box(4, 4, 6, 6)
    for level, first, held in ((48.0, False, True), (52.0, True, True), (40.0, False, False)):
        values[4, 10] = level
        assert found(values)[4, 10] == first and found(values, before=box(4, 4, 6, 7))[4, 10] == held


def test_a_light_contact_does_not_flicker_about_the_noise():
    values = 2.7 * box(4, 4, 3, 3)
    assert not found(values).any()
    np.testing.assert_array_equal(found(values, before=box(4, 4, 3, 3)), box(4, 4, 3, 3))
    assert not found(2.4 * box(4, 4, 3, 3), before=EVERYWHERE).any()


@pytest.mark.parametrize('taxels, height, is_found', [
    (1, 5.0, False), (1, 7.0, True), (3, 5.0, False), (3, 7.0, True), (4, 3.5, True), (4, 2.5, False)])
def test_a_small_group_has_to_be_stronger(taxels, height, is_found):
    values = np.zeros((SIDE, SIDE))
    values[[3, 3, 4, 4][:taxels], [3, 4, 3, 4][:taxels]] = height
    assert found(values).any() == is_found


def test_a_unit_has_a_least_value_and_each_taxel_its_own_noise():
    least, loud = FLOOR._replace(least=50.0), FLOOR._replace(noise=np.where(box(0, 0, 8, 16), 10.0, 1.0))
    values = 20.0 * (box(2, 2, 3, 3) | box(10, 10, 3, 3))
    assert not found(values, least).any() and found(3 * values, least).sum() == 18
    np.testing.assert_array_equal(found(values, loud), box(10, 10, 3, 3))


def test_what_has_no_value_is_not_pressed_and_tears_nothing_away():
    values = 100.0 * box(4, 4, 6, 6)
    values[6] = np.nan
    values[12, 12] = np.inf
    np.testing.assert_array_equal(found(values), box(4, 4, 6, 6) & (ROWS != 6))


@pytest.mark.parametrize('factor', [1e-12, 1 / 7, 1000.0, 1e100])
def test_without_a_unit_only_the_proportions_count(factor):
    rng, plain, scaled = np.random.default_rng(5), PatternExtractor(), PatternExtractor()
    for k in range(60):
        values = rng.standard_normal((SIDE, SIDE)) + (k > 20) * 30 * flat(*rng.uniform(2, 6, 4))
        one, other = plain.extract(values), scaled.extract(values * factor)
        np.testing.assert_array_equal(one.labels, other.labels)
        np.testing.assert_allclose(other.noise, one.noise * factor, rtol=1e-6)


@pytest.mark.parametrize('dtype', [bool, np.uint8, np.int64, np.float32, float])
def test_arrays_of_two_levels(dtype):
    mask = box(4, 5, 6, 7)
    np.testing.assert_array_equal(PatternExtractor().extract(mask.astype(dtype)).mask, mask)
    if dtype is not bool:
        np.testing.assert_array_equal(PatternExtractor().extract((5 + 4 * mask).astype(dtype)).mask, mask)


@pytest.mark.parametrize('unit', [None, 'Pa', 'N'])
@pytest.mark.parametrize('shape', [(1, 1), (1, 20), (4, 4), (8, 8), (64, 64)])
def test_no_array_of_numbers_warns_or_fails(shape, unit):
    rng = np.random.default_rng(8)
    plain = rng.standard_normal(shape)
    raised = plain + 50 * (rng.random(shape) < 0.3)
    holed, huge = np.where(rng.random(shape) < 0.3, np.nan, raised), raised.copy()
    huge.flat[0] = 1e305
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        for base in (plain, raised, holed, huge, raised - 1000, np.rint(raised), np.full(shape, 7.0),
                     np.zeros(shape), np.full(shape, np.nan), raised > 25):
            extractor = PatternExtractor(unit=unit)
            for factor in (1.0, 1e100, 1e-12, 1e-300):
                with np.errstate(over='ignore', under='ignore'):
                    frame = base if base.dtype == bool else base * factor
                pattern = extractor.extract(frame)
                known = pattern.noise[np.isfinite(pattern.noise)]
                assert (known >= 0).all() and pattern.labels.max() == min(pattern.contacts, 255)
                assert not (pattern.labels[pattern.hidden & ~pattern.mask]).any()
