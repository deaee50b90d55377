"""A taxel is reported as faulty only if no healthy taxel could send the same values.

The tests also cover gains, and the file that lists known faults.
"""

import os

import numpy as np
import pytest

from tactile_node.conditioning.conditioned_pad import ConditionedPad
from tactile_node.conditioning.faulty_taxels_file import load_faults, save_faults
from tactile_node.conditioning.gain import load_gains
from tactile_node.conditioning.tare import ContactGuard
from tactile_node.conditioning.tared_pad import TaredPad
from tactile_node.conditioning.taxel_faults import FaultDetector, FaultyTaxels, TaxelFault
from tactile_node.errors import ConfigurationError
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus

LONG = bool(os.environ.get('TACTILE_LONG'))
SIDE, LIMIT, PRESS, FULL, PERIOD = 12, 10.0, 60.0, 100.0, 0.02
GUARD = ContactGuard.of_unit('Pa')
DEAD, STUCK, FLICKERING, SATURATED = (kind for kind in TaxelFault if kind)
ROWS, COLS = np.mgrid[:SIDE, :SIDE]


def disc(row, col, radius, hole=-1.0):
    distance = np.hypot(ROWS - row, COLS - col)
    return (distance <= radius) & (distance > hole)


class Pad:
    """A pad that is pressed by each mask of a sequence in turn.

    ``spoil(values, frame_number)`` returns the values that the faulty pad sends.
    """

    def __init__(self, spoil=lambda values, n: values, noise=0.3, seed=1):
        self.detector = FaultDetector(SIDE, SIDE, LIMIT)
        self._spoil = spoil
        self._noise = noise
        self._n = 0
        self._random, self.ever = np.random.default_rng(seed), np.zeros((SIDE, SIDE), np.uint8)

    def frames(self, mask, count):
        for _ in range(count):
            values = PRESS * mask + self._noise * self._random.standard_normal((SIDE, SIDE))
            values = np.clip(self._spoil(values, self._n), 0, FULL)
            found = self.detector.update(PERIOD * self._n, values, 0.0, values >= FULL)
            self.ever = np.maximum(self.ever, found.kinds)
            self._n += 1
        return found

    def touches(self, *masks, press=10, pause=10):
        for mask in masks:
            self.frames(mask, press)
            found = self.frames(np.zeros((SIDE, SIDE)), pause)
        return found


def places(count=8, seed=3):
    random = np.random.default_rng(seed)
    return [disc(*random.uniform(3, 8, 2), random.uniform(3, 4.5)) for _ in range(count)]


def setting(place, value):
    def spoil(values, n):
        values[place] = value(n) if callable(value) else value
        return values
    return spoil


@pytest.mark.parametrize(('value', 'kind'), [(0.0, DEAD), (0.3 * LIMIT, DEAD), (0.9 * LIMIT, DEAD), (42.0, STUCK),
                                             (FULL, SATURATED)])
def test_found_after_a_few_contacts_and_nothing_else(value, kind):
    found = Pad(setting((5, 6), value)).touches(*places())
    assert found.places(kind) == [(5, 6)] and found.total == 1


@pytest.mark.parametrize(('values', 'kinds'), [((42.0, 42.0), (STUCK, STUCK)), ((42.0, FULL), (STUCK, SATURATED)),
                                               ((FULL, lambda n: 80.0 * (n % 2)), (SATURATED, FLICKERING))])
def test_faults_side_by_side_are_found(values, kinds):
    def spoil(given, n):
        return setting((5, 6), values[0])(setting((6, 7), values[1])(given, n), n)
    found = Pad(spoil).touches(*places(), pause=30)
    assert (found.kinds[5, 6], found.kinds[6, 7], found.total) == (*kinds, 2)


def test_a_stuck_taxel_stays_so_within_a_contact_and_while_another_begins_to_flicker():
    flickering = setting((9, 9), lambda n: 80.0 * (n % 2) if n > 160 else 0.0)
    pad = Pad(lambda values, n: setting((5, 6), 42.0)(flickering(values, n), n))
    assert pad.touches(*places()).places(STUCK) == [(5, 6)]
    for _ in range(100):
        assert pad.frames(disc(5, 6, 2), 1).places(STUCK) == [(5, 6)]
    assert pad.detector.faults.places(FLICKERING) == [(9, 9)]


def test_enough_taxels_for_a_contact_are_an_object_even_if_their_values_stay_the_same():
    row = (5, slice(5, 8))
    pad = Pad(setting(row, 42.0), noise=0.0)
    pad.touches(*places())
    assert not pad.ever.any()


def test_a_dead_column_is_found_in_its_touched_part():
    masks = places(20)
    found = Pad(setting((slice(None), 6), 0.0)).touches(*masks)
    reached = {(row, 6) for row in range(4, 8)}
    assert reached <= set(found.places(DEAD)) <= {(row, 6) for row in range(SIDE)}


def test_flickering_is_taken_back_when_it_ends():
    pad = Pad(setting((2, 3), lambda n: 80.0 * (n % 2 and n < 100)))
    still = np.zeros((SIDE, SIDE))
    assert pad.frames(still, 100).total == 1 and pad.frames(still, 1000).total == 0


def test_a_sign_of_life_clears_the_fault():
    pad = Pad(lambda values, n: setting((5, 6), 0.0)(values, n) if n < 160 else values)
    assert pad.touches(*places()).places(DEAD) == [(5, 6)]
    assert pad.touches(disc(5, 6, 3)).total == 0


@pytest.mark.slow
def test_healthy_pads_stay_unsuspected():
    """The pads are untouched, held with a trembling edge, tapped fast, pressed by a ring, or poked at one taxel.

    The object is held for two minutes, or for ten minutes with TACTILE_LONG.
    """
    nothing, held, edge = np.zeros((SIDE, SIDE)), disc(6, 6, 3), disc(6, 6, 4)
    for noise in (0.0, 0.5):
        pad = Pad(noise=noise)
        pad.frames(nothing, 2000)
        for n in range((30_000 if LONG else 6000) if noise else 3000):
            pad.frames(edge if n % 7 < 3 else held, 1)
        pad.touches(*[held] * 40, press=2, pause=2)
        pad.touches(*[disc(6, 6, 4, hole=1.2)] * 40)
        pad.touches(*[disc(6, 6, 0.5)] * 20)
        assert not pad.ever.any()


@pytest.mark.parametrize('hole', [1.2, 1.6, 2.1])
@pytest.mark.parametrize('scatter', [0.5, 1.5])
def test_a_ring_that_returns_slightly_displaced_causes_no_fault(hole, scatter):
    random = np.random.default_rng(9)
    pad = Pad()
    pad.touches(*[disc(*random.normal(6, scatter, 2), hole + 2, hole=hole) for _ in range(200)], press=4, pause=4)
    assert not pad.ever.any()


@pytest.mark.parametrize('stuck', [[(6, 6)], [(6, 6), (6, 7)]])
def test_a_taxel_that_sticks_in_a_touch_is_found_by_the_next_ones_in_the_same_place(stuck):
    def spoil(values, n):
        for place in stuck if n >= 25 else ():
            values[place] = 42.0
        return values
    found = Pad(spoil).touches(*[disc(6, 6, 1.5)] * 10)
    assert found.places(STUCK) == stuck and found.total == len(stuck)


def test_frames_without_values_add_no_evidence():
    pad = Pad(lambda values, n: np.where(n % 3 == 0, np.nan, values))
    pad.touches(*places())
    assert not pad.ever.any()


def frame(values, status=TaxelStatus.VALID):
    values = np.asarray(values, np.float32)
    return TaxelFrame(1.0, 0, values, np.full(values.shape, status, np.uint8), missing_can_frames=0)


def known(*taxels):
    kinds = np.zeros((2, 2), np.uint8)
    for row, col, kind in taxels:
        kinds[row, col] = kind
    return FaultyTaxels(kinds)


def test_known_taxels_are_nan_from_the_first_frame_with_their_reason():
    pad = ConditionedPad(TaredPad(GUARD), FaultDetector(2, 2, LIMIT), known((0, 1, DEAD), (1, 0, STUCK)))
    got = pad.feed(frame([[1, 2], [3, 4]]))
    np.testing.assert_array_equal(got.values, np.array([[1, np.nan], [np.nan, 4]], np.float32))
    assert got.status.tolist() == [[TaxelStatus.VALID, TaxelStatus.DEAD], [TaxelStatus.FAULTY, TaxelStatus.VALID]]
    assert not got.values.flags.writeable
    assert pad.faults.total == 2


def test_detected_faults_are_masked_only_on_request():
    pad = ConditionedPad(TaredPad(GUARD), FaultDetector(2, 2, LIMIT), known())
    pad.detector.update = lambda *_: known((0, 1, DEAD))
    assert pad.feed(frame([[1, 2], [3, 4]])).values.tolist() == [[1, 2], [3, 4]] and pad.faults.total == 1
    pad.masks = True
    assert np.isnan(pad.feed(frame([[1, 2], [3, 4]])).values[0, 1])


def test_objects_that_are_held_squeezed_or_hollow_make_no_taxel_faulty():
    """The cases are a saturated core, an object tapped next to a held object, and a tube gripped more firmly."""
    core, small = disc(6, 6, 1), disc(2, 2, 1)
    pad = Pad(lambda values, n: np.where(core & (n >= 10), FULL, values), noise=0.0)
    pad.frames(core, 10)
    for _ in range(12):
        pad.frames(disc(6, 6, 3), 20)
        pad.frames(core, 20)
    assert not pad.ever.any()
    pad = Pad(noise=0.0)
    pad.frames(small, 50)
    for _ in range(12):
        pad.frames(small | disc(8, 8, 2.3), 20)
        pad.frames(small, 20)
    assert not pad.ever.any()
    pad = Pad()
    pad.touches(*[disc(6, 6, 3, hole=1.2)] * 6, disc(6, 6, 4, hole=1.2), *[disc(6, 6, 3, hole=1.2)] * 6)
    assert not pad.ever.any()


def test_a_weak_taxel_is_not_dead():
    pad = Pad()
    pad._spoil = lambda values, n: setting((5, 6), values[5, 6] / 8)(values, n)
    pad.touches(*places(20))
    assert not pad.ever.any()


def test_gains_multiply_the_readings_above_the_zero():
    tared, gains = TaredPad(GUARD), np.array([[1, 2], [0.5, 4]], np.float32)
    tared.offset = np.full((2, 2), 10, np.float32)
    pad = ConditionedPad(tared, FaultDetector(2, 2, LIMIT), known((1, 1, DEAD)), gains)
    np.testing.assert_array_equal(pad.feed(frame([[11, 12], [14, 20]])).values,
                                  np.array([[1, 4], [2, np.nan]], np.float32))


def test_gain_files(tmp_path):
    text, binary = tmp_path / 'gains.csv', tmp_path / 'gains.npy'
    text.write_text('# of the left finger\n1.0, 1.1, 0.9\n1, 1, 1.2\n')
    np.save(binary, load_gains(text, 2, 3))
    assert load_gains(binary, 2, 3).tolist() == np.array([[1, 1.1, 0.9], [1, 1, 1.2]], np.float32).tolist()


@pytest.mark.parametrize(('content', 'says'), [
    ('1 1\n1 1\n', '2 rows of 3 gains'), ('1 1 1\n1 x 1\n', 'numbers'), ('1 1 1\n1 0 1\n', 'row 1, column 1'),
    ('1 1 1\n1 nan 1\n', 'row 1, column 1'), ('', 'shape'), ('1 1 1\n1 1\n', 'numbers'),
    ('1 1 1\n1 -1 1\n', 'row 1, column 1'), ('1 1 1\n1 inf 1\n', 'row 1, column 1'),
    (1000 * '1 1 1\n', 'too much for this pad')])
@pytest.mark.filterwarnings('ignore:.*input contained no data')
def test_bad_gain_files(tmp_path, content, says):
    path = tmp_path / 'gains.txt'
    path.write_text(content)
    with pytest.raises(ConfigurationError, match=says):
        load_gains(path, 2, 3)
    with pytest.raises(ConfigurationError, match='No such file'):
        load_gains(tmp_path / 'none.npy', 2, 3)
    broken = tmp_path / 'broken.npy'
    broken.write_bytes(b'\x93NUMPY\x01\x00garbage')
    with pytest.raises(ConfigurationError, match='numbers'):
        load_gains(broken, 2, 3)


def test_faults_are_kept_on_file_beside_those_of_other_pads(tmp_path):
    path = tmp_path / 'new' / 'faults.yaml'
    save_faults(path, {'left': known((0, 1, DEAD), (1, 1, FLICKERING))})
    save_faults(path, {'right': known((1, 0, SATURATED))})
    left, right = load_faults(path, {'left': (2, 2), 'right': (2, 2)}).values()
    assert left.places(DEAD) == [(0, 1)] and left.places(FLICKERING) == [(1, 1)] and left.total == 2
    assert right.places(SATURATED) == [(1, 0)] and right.total == 1
    assert load_faults(tmp_path / 'none.yaml', {'left': (2, 2)})['left'].total == 0


@pytest.mark.parametrize(('content', 'says'), [
    ('pads: {left: {dead: [[2, 0]]}}', 'left.dead'), ('pads: {left: {dead: [[0, 2]]}}', 'left.dead'),
    ('pads: {left: {daed: [[0, 1]]}}', 'Rename it to "dead"'), ('pad: {}', 'pads'), ('pads: {left: 3}', 'left'),
    ('[', 'YAML')])
def test_bad_files_of_faults(tmp_path, content, says):
    path = tmp_path / 'faults.yaml'
    path.write_text(content)
    with pytest.raises(ConfigurationError, match=says):
        load_faults(path, {'left': (2, 2)})


def test_a_pad_that_repeats_identical_values_is_frozen_on_request():
    pad, random = ConditionedPad(TaredPad(GUARD), FaultDetector(2, 2, LIMIT), known()), np.random.default_rng(2)
    last = random.standard_normal((2, 2))
    live = [frame(random.standard_normal((2, 2)))._replace(stamp=0.02 * n) for n in range(50)]
    frozen = [frame(last)._replace(stamp=1 + 0.02 * n) for n in range(60)]
    assert np.isfinite([pad.feed(each).values for each in live + frozen]).all()
    assert pad.unchanged == pytest.approx(0.02 * 59) and not pad.is_frozen
    pad = ConditionedPad(TaredPad(GUARD), FaultDetector(2, 2, LIMIT), known())
    pad.frozen_after = 0.5
    given = [pad.feed(each) for each in live + frozen + [frame(-last)._replace(stamp=2.5)]]
    valid = [bool(np.isfinite(each.values).all()) for each in given]
    # The limit of 0.5 s is reached 25 frames after the first of the equal frames.
    assert valid == [True] * (50 + 25) + [False] * 35 + [True]
    assert (given[-2].status == TaxelStatus.STALE).all() and not given[-2].values.flags.writeable
