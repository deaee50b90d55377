"""Taxels that rise above the noise, and the outline of a contact."""

import warnings
from math import erf

import numpy as np
import pytest
from patterns import COLS, ROWS, box

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.standing_out import Threshold, standing_out

SIDE = 16
NOWHERE = np.zeros((SIDE, SIDE), bool)
EVERYWHERE = ~NOWHERE
FLOOR = Threshold(0.0, np.ones((SIDE, SIDE)), 0.0)
#: Profile of an edge that is blurred by a Gaussian.
PHI = np.vectorize(lambda x: (1 + erf(x / 2 ** 0.5)) / 2)


def flat(row, col, rows, cols, blur=0.6):
    """Return the values under an indenter of level 1 with blurred edges, in closed form.

    Exactly at the edges of the indenter, the value is half of the level.
    """
    def along(place, first, length):
        return PHI((place - first) / blur) - PHI((place - first - length) / blur)
    return along(ROWS, row, rows) * along(COLS, col, cols)


def found(values, threshold=FLOOR, before=NOWHERE):
    return standing_out(values, np.isfinite(values), threshold, before)[0]


def far_from_the_edge(row, col, rows, cols, by):
    """Return two masks: taxels farther than ``by`` from the outline and its corners, and taxels inside the outline.

    At a corner, the expected value is less than half of the level.
    """
    down, along = np.minimum(ROWS - row, row + rows - ROWS), np.minimum(COLS - col, col + cols - COLS)
    is_corner = (abs(down) < 1) & (abs(along) < 1)
    return (abs(down) > by) & (abs(along) > by) & ~is_corner, (down > 0) & (along > 0)


@pytest.mark.parametrize('tilt', [0.0, 0.3, 0.6])
@pytest.mark.parametrize('height', [20.0, 100.0, 1e5])
def test_the_outline_is_at_half_of_the_local_level_under_tilt(height, tilt):
    """From one side of the contact to the other, the level rises by ``tilt`` times its mean."""
    rng = np.random.default_rng(1)
    for _ in range(40):
        row, col = rng.uniform(2, 5, 2)
        rows, cols = rng.uniform(5, 9, 2)
        level = height * (1 + tilt * (COLS - col - cols / 2) / cols)
        pressed = found(level * flat(row, col, rows, cols))
        is_clear, inside = far_from_the_edge(row, col, rows, cols, 0.3)
        np.testing.assert_array_equal(pressed[is_clear], inside[is_clear])


def test_exactly_the_taxels_of_a_contact_with_a_hard_edge_are_pressed():
    rng = np.random.default_rng(2)
    for rows, cols in ((2, 2), (4, 7), (12, 12), (1, 9), (16, 9)):  # The largest contact covers 56 % of the pad.
        mask = box(2 if rows < 16 else 0, 2, rows, cols)
        pattern = PatternExtractor().extract(20.0 * mask + rng.standard_normal(mask.shape))
        np.testing.assert_array_equal(pattern.labels == 1, mask)


def test_a_weak_taxel_between_stays_pressed_a_little_longer():
    values, mask = 100.0 * box(4, 4, 6, 6), box(4, 4, 6, 6)
    for level, first, held in ((18.0, False, True), (24.0, True, True), (15.0, False, False)):
        values[6, 6] = level
        assert found(values)[6, 6] == first and found(values, before=mask)[6, 6] == held


def test_a_pressed_taxel_stays_pressed_a_little_longer():
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


def test_taxels_without_a_value_are_not_pressed_and_do_not_split_the_contact():
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


@pytest.mark.parametrize('gap', [1, 2, 3])
def test_beside_a_stronger_contact_a_weak_one_never_hides_it(gap):
    strong, weak = box(4, 1, 6, 5), box(5, 6 + gap, 4, 4)
    pressed = found(1000.0 * strong + 100 * weak)
    np.testing.assert_array_equal(pressed & ~weak, strong)


@pytest.mark.parametrize('weak', [0.25, 1 / 3, 0.45])
def test_taxels_of_low_gain_leave_a_contact_whole(weak):
    """A fifth of the taxels, but none at the corners, reads only ``weak`` times the value of the others."""
    rng, mask = np.random.default_rng(11), box(4, 3, 7, 9)
    corners = np.isin(ROWS, (4, 10)) & np.isin(COLS, (3, 11))
    for _ in range(40):
        faint = (rng.random(mask.shape) < 0.2) & ~corners
        faint &= ~np.roll(faint, 1, 0) & ~np.roll(faint, 1, 1)
        np.testing.assert_array_equal(found(100.0 * mask * np.where(faint, weak, 1.0)), mask)


@pytest.mark.parametrize('turn', [np.asarray, np.transpose])
@pytest.mark.parametrize('rows', [1, 2])
def test_a_weak_line_tears_no_bar(rows, turn):
    """A bar crosses a pad of six columns. One or two rows of the bar read a third of what the other rows read."""
    bar = np.zeros((14, 6))
    bar[3:9] = 100.0
    bar[5:5 + rows] /= 3
    bar = turn(bar)
    pattern = PatternExtractor(unit=None).extract(bar + np.random.default_rng(12).standard_normal(bar.shape))
    assert pattern.contacts == 1
    np.testing.assert_array_equal(pattern.mask, bar > 0)


@pytest.mark.parametrize('other', [1.0, 0.7, 0.4])
@pytest.mark.parametrize('gap', [1, 2, 3])
def test_contacts_with_taxels_below_a_fifth_of_both_between_them_stay_two(gap, other):
    one, two = box(4, 1, 6, 5), box(4, 6 + gap, 6, 5)
    pattern = PatternExtractor().extract(1000.0 * one + 1000 * other * two + 190 * other * box(4, 6, 6, gap)
                                         + np.random.default_rng(13).standard_normal(one.shape))
    assert pattern.contacts == 2 and pattern.sizes == (30, 30)


@pytest.mark.parametrize('specks, is_whole', [(0, True), (2, True), (6, False)])
def test_on_a_pad_full_of_specks_nothing_is_joined(specks, is_whole):
    """Scattered specks are noise, but joined specks would look like a contact."""
    mask, values = box(2, 2, 5, 5), 100.0 * box(2, 2, 5, 5)
    values[4, 4] = 30.0
    values[13, 1:2 * specks:2] = 100.0
    assert found(values)[mask].all() == is_whole


@pytest.mark.parametrize('inner', [0.05, 0.19])
def test_a_hollow_contact_stays_hollow(inner):
    outer, hole = box(3, 3, 9, 9), box(5, 5, 5, 5)
    np.testing.assert_array_equal(found(1000.0 * outer * np.where(hole, inner, 1.0)), outer & ~hole)


def test_noise_alone_seldom_makes_a_group():
    """Fewer than 1 % of 400 separate arrays of 16x16 taxels of pure noise may have a group of 4 or more taxels."""
    rng = np.random.default_rng(9)
    patterns = [PatternExtractor().extract(rng.standard_normal((SIDE, SIDE)) + 7) for _ in range(400)]
    assert sum(pattern.mask.sum() >= 4 for pattern in patterns) < 4
    assert sum(pattern.contacts > 0 for pattern in patterns) < 20


@pytest.mark.parametrize('deviation', [0.3, 0.75, 1.0, 1.5])
def test_idle_counts_press_nothing_and_a_light_contact_on_them_is_found(deviation):
    rng, stream, mask = np.random.default_rng(10), PatternExtractor(), box(4, 5, 6, 7)
    idle = [np.rint(deviation * rng.standard_normal((SIDE, SIDE))) for _ in range(150)]
    assert sum(stream.extract(frame).contacts > 0 for frame in idle) < 5
    assert sum(PatternExtractor().extract(frame).contacts > 0 for frame in idle) < 5
    pattern = PatternExtractor().extract(np.rint(idle[0] + max(8 * deviation, 6) * mask))
    np.testing.assert_array_equal(pattern.labels == 1, mask)


@pytest.mark.parametrize('before', [None, 0.0, 0.04])
def test_a_wide_halo_is_not_a_contact_after_any_earlier_contact(before):
    y, x = np.mgrid[:9, :16]
    away = np.hypot(np.maximum(np.abs(y - 4) - 2, 0), np.maximum(np.abs(x - 11) - 2, 0))
    frame = np.where(away == 0, 1.0, 0.04 + 0.3 / (1 + away ** 2 / 9) ** 1.5)
    extractor = PatternExtractor()
    if before is not None:
        idle = np.full(frame.shape, before)
        idle[0, 0] += 1e-4  # If all values were equal, the frame could count as on/off.
        idle[3, 3] += 2e-4
        extractor.extract(idle)
    np.testing.assert_array_equal(extractor.extract(frame).mask, away == 0)
