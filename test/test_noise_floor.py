"""Learning the noise floor of a pad, even while an object rests on the pad."""

import os
from itertools import product

import numpy as np
import pytest

from tactile_node.contact.noise_floor import NoiseFloor, resting_of
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.taxel_frame import PRESS_BY_UNIT, RELEASE_RATIO

SHAPE = (12, 12)
ROWS, COLS = np.mgrid[:12, :12]
SQUARE = (ROWS >= 3) & (ROWS < 9) & (COLS >= 4) & (COLS < 9)
NOISE = {'Pa': 1e3, 'N': 0.0035, None: 10.0}  #: Standard deviation of the noise, which is 1 % of full scale.
LONG = bool(os.environ.get('TACTILE_LONG'))
WHOLE, HALF, MOST = np.ones(SHAPE, bool), COLS < 6, ROWS < 11
MASKS = {'whole': WHOLE, 'half': HALF, '11 of 12': MOST}


def patterns(heights, unit, mask=SQUARE, *, seed=1, fixed=None):
    """Yield the pattern of each frame, in which ``mask`` is raised by one of ``heights``.

    The unit of ``heights`` is the standard deviation of the noise.
    """
    rng, extractor = np.random.default_rng(seed), PatternExtractor(fixed, unit=unit)
    for height in heights:
        yield extractor.extract(NOISE[unit] * (height * mask + rng.standard_normal(SHAPE)))


def check_held(heights, unit, mask, *, from_height):
    """Check that the contact is found in each frame whose height has reached ``from_height``.

    In the last frame, the contact must be complete, and its taxels must not have been learnt as noise.
    """
    least = mask.sum() / 2
    for height, pattern in zip(heights, patterns(heights, unit, mask)):
        if height >= from_height:
            assert pattern.contacts and pattern.mask.sum() >= least, height
    np.testing.assert_array_equal(pattern.mask, mask)
    if mask is not WHOLE and np.isfinite(pattern.noise).any():
        assert np.median(pattern.noise[mask]) < 2 * NOISE[unit]


def each(*short, **names):
    """Return a mark that runs the cases in ``short``, or all combinations of ``names`` with TACTILE_LONG."""
    every = [dict(zip(names, values)) for values in product(*names.values())]
    chosen = every if LONG else [dict(zip(names, values)) for values in short]
    return pytest.mark.parametrize(tuple(names), [tuple(case.values()) for case in chosen])


@pytest.mark.slow
@each((1, 'N'), (1, None), seconds=(1, 10, 60), unit=NOISE)
def test_a_contact_that_grows_slowly_is_never_noise(seconds, unit):
    heights = np.concatenate((np.zeros(50), np.linspace(0, 30, 50 * seconds), np.full(100, 30.0)))
    check_held(heights, unit, SQUARE, from_height=10)


@pytest.mark.slow
@each((1000, None), frames=(1000, 2000), unit=NOISE)
def test_an_object_held_from_the_first_frame_is_never_noise(frames, unit):
    """The noise floor uses the last 500 frames, and the object is held for at least twice that time.

    After the release, the pad must be empty at once.
    """
    heights = np.concatenate((np.full(frames, 20.0), np.zeros(5)))
    *held, a, b, c, d, free = patterns(heights, unit)
    assert all((pattern.mask == SQUARE).all() for pattern in held)
    assert not free.contacts and free.pad_seen


@pytest.mark.slow
@each(('whole', None), ('half', 'N'), mask=MASKS, unit=NOISE)
def test_an_object_that_covers_the_pad_after_rest_is_held(mask, unit):
    heights = np.concatenate((np.zeros(60), np.full(600, 20.0)))
    check_held(heights, unit, MASKS[mask], from_height=10)


@pytest.mark.slow
@each((0, 'whole', 'N'), (5, '11 of 12', 'Pa'), seconds=(0, 5, 20), mask=MASKS, unit=('Pa', 'N'))
def test_with_a_unit_the_pad_may_be_covered_from_the_start_or_slowly(seconds, mask, unit):
    heights = np.concatenate((np.linspace(0, 20, 50 * seconds), np.full(300, 20.0)))
    check_held(heights, unit, MASKS[mask], from_height=12)


@pytest.mark.slow
@each(('Pa',), unit=('Pa', 'N'))
def test_a_contact_between_noise_and_fixed_thresholds_is_not_learned(unit):
    """With absolute thresholds, the taxels of a light contact are not pressed.

    The noise floor must not rise to the values of a light contact.
    """
    fixed = PressThresholds(PRESS_BY_UNIT[unit], RELEASE_RATIO * PRESS_BY_UNIT[unit])
    heights = np.concatenate((np.zeros(50), np.full(1000, 9.0)))
    *_, last = patterns(heights, unit, fixed=fixed)
    assert not last.contacts and last.noise[SQUARE].max() < 2 * NOISE[unit]


@each(('Pa',), (None,), unit=NOISE)
def test_the_noise_of_each_taxel_is_found(unit):
    """Each taxel of an idle pad has 0.7 to 1.5 times the average noise.

    For nine taxels in ten, the estimate must lie within 20 % of the true noise.
    """
    rng = np.random.default_rng(3)
    drawn = rng.uniform(0.7, 1.5, SHAPE)
    extractor = PatternExtractor(unit=unit)
    for _ in range(600):
        pattern = extractor.extract(NOISE[unit] * drawn * rng.standard_normal(SHAPE))
    ratio = pattern.noise / NOISE[unit] / drawn
    # All other taxels have the average noise of the pad, because the estimate never falls below it.
    is_above = drawn > 1.2
    assert (abs(ratio[is_above] - 1) < 0.2).mean() > 0.9 and not pattern.noise.flags.writeable
    assert (pattern.noise > 0.7 * NOISE[unit]).all()


@pytest.mark.parametrize('sense', [-1, 1])
def test_a_slow_drift_is_followed_up_and_down(sense):
    """All values drift by one standard deviation per second.

    A contact on the drifting values must be found with exactly its own taxels.
    """
    rng, extractor = np.random.default_rng(6), PatternExtractor()
    for k in range(500):
        assert not extractor.extract(sense * k / 50 + rng.standard_normal(SHAPE)).contacts
    np.testing.assert_array_equal(extractor.extract(sense * 10 + 25 * SQUARE + rng.standard_normal(SHAPE)).mask, SQUARE)


def test_taxels_without_a_value_learn_nothing_and_spoil_nothing():
    rng, floor, dead = np.random.default_rng(9), NoiseFloor(), ROWS % 4 == 0
    for _ in range(100):
        values = np.where(dead, np.nan, rng.standard_normal(SHAPE))
        level, noise = floor.measure(values, ~dead)
        floor.learn(values, noise, ~dead)
        assert np.isfinite(noise).all() and np.isfinite(level)
    assert 0.7 < noise.min() and noise.max() < 1.6 and abs(level) < 0.4


def test_a_few_taxels_and_a_pad_that_is_not_seen_have_no_floor():
    nothing = np.full((2, 3), np.nan)
    for values in (np.arange(6.0).reshape(2, 3), nothing):
        level, noise = NoiseFloor().measure(values, np.isfinite(values))
        assert level == 0 and not noise.any()
    assert np.isnan(PatternExtractor().extract(nothing).noise).all()


def test_the_floor_stays_while_the_pad_is_not_seen():
    rng, floor = np.random.default_rng(10), NoiseFloor()
    for _ in range(50):
        values = 100 + rng.standard_normal(SHAPE)
        known = floor.measure(values, WHOLE)
        floor.learn(values, known[1], WHOLE)
    level, noise = floor.measure(np.full(SHAPE, np.nan), ~WHOLE)
    assert abs(level - 100) < 0.5 and (noise > 0.5).all()


def test_values_that_were_tared_have_a_level_that_no_pad_at_rest_reaches():
    values = np.full(SHAPE, 50.0)
    assert NoiseFloor(highest=7.0).measure(values, WHOLE)[0] == 0
    assert NoiseFloor().measure(values, WHOLE)[0] == pytest.approx(50.0)


@pytest.mark.slow
@each((None,), unit=('Pa', None))
def test_an_object_that_is_held_does_not_drown_in_noise_that_rises(unit):
    """A motor starts, and the noise becomes ten times as large. No frame may report the pad as empty."""
    rng, extractor, held = np.random.default_rng(8), PatternExtractor(unit=unit), np.zeros((16, 16))
    held[5:11, 5:11] = 20e3
    for _ in range(100):
        extractor.extract(1e3 * rng.standard_normal((16, 16)))
    for _ in range(50):
        assert extractor.extract(held + 1e3 * rng.standard_normal((16, 16))).contacts == 1
    for _ in range(300):
        found = extractor.extract(held + 1e4 * rng.standard_normal((16, 16)))
        assert found.contacts or not found.pad_seen


def test_level_and_noise_are_those_of_the_resting_taxels():
    rng = np.random.default_rng(1)
    values = 2.0 * rng.standard_normal((32, 32)) + 7
    values[3:27, 3:27] = 1000  # The object covers more than half of the pad.
    found = resting_of(values)
    assert (found.level, found.deviation) == (pytest.approx(7.0, abs=0.4), pytest.approx(2.0, rel=0.1))
    values[28, :5] = 300
    assert resting_of(values).deviation == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize('taxels', [1, 5, 20, 31])
@pytest.mark.parametrize('below', [30.0, 1e3, 1e6])
def test_a_few_taxels_far_below_the_others_hide_no_contact(taxels, below):
    """Taxels that have lost their offset have values far below the others.

    If these taxels counted as noise, no taxel would be pressed, and a held object would be lost.
    """
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


#: Level at rest before a skin cuts off the readings below its zero, and the steps of its values. The unit of both is
#: the standard deviation of the noise.
CUTS = {'half of the noise': (0.0, 1e-9), 'more than half': (-0.5, 1e-9), 'less than half': (0.6, 1e-9),
        '8 bits': (0.0, 0.39)}


@pytest.fixture(params=CUTS.values(), ids=CUTS)
def cut_off(request):
    """Return a function that yields the readings of a skin that reads no values below its zero."""
    rest, step = request.param
    rng = np.random.default_rng(21)

    def readings(frames, noise, pressed=0.0):
        for _ in range(frames):
            values = (pressed + noise * (rest + rng.standard_normal((16, 16)))) / (step * noise)
            yield np.maximum(np.rint(values), 0) * step * noise
    return readings


@each(('Pa',), (None,), unit=NOISE)
def test_a_pad_that_reads_nothing_below_zero_is_empty_at_rest(unit, cut_off):
    extractor = PatternExtractor(unit=unit)
    empty = [extractor.extract(frame).contacts == 0 for frame in cut_off(100, NOISE[unit])]
    assert np.mean(empty) > 0.98


@each((6.0, 'Pa'), (15.0, None), height=(6.0, 15.0), unit=NOISE)
def test_a_contact_on_such_a_pad_is_found_whole_and_alone(unit, height, cut_off):
    extractor, held = PatternExtractor(unit=unit), np.zeros((16, 16))
    held[4:11, 5:12] = height * NOISE[unit]
    for frame in cut_off(30, NOISE[unit]):
        extractor.extract(frame)
    for frame in cut_off(300 if LONG else 60, NOISE[unit], held):
        found = extractor.extract(frame)
        assert found.contacts == 1
    assert np.count_nonzero(found.mask != (held > 0)) <= 2
    assert np.median(found.noise) == pytest.approx(NOISE[unit], rel=0.3)


RIDGES = {'columns': COLS % 3 == 0, 'rows': ROWS % 4 == 1, 'diagonals': (ROWS + COLS) % 4 == 0,
          'pins': (ROWS % 2 == 0) & (COLS % 3 == 0), 'knurl': (ROWS + COLS) % 2 == 0}


@pytest.mark.parametrize('ridges', [*RIDGES.values(), 'scattered'], ids=[*RIDGES, 'scattered'])
@pytest.mark.parametrize('noise', [0.0, 0.02])
def test_ridges_and_pins_on_such_a_pad_are_not_noise(ridges, noise):
    """A gripper holds a rasp or a brush. A planner that reads "empty" would drop it."""
    rng, extractor = np.random.default_rng(23), PatternExtractor()
    ridges = rng.random(SHAPE) < 0.25 if isinstance(ridges, str) else ridges
    for pressure in (0.0, 1.0):
        for _ in range(30):
            gains = rng.uniform(0.8, 1.2, SHAPE)
            found = extractor.extract(np.maximum(pressure * ridges * gains + noise * rng.standard_normal(SHAPE), 0))
        assert (found.contacts > 0) == (pressure > 0)
