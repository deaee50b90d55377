"""Taxels that stay on after a release count as hidden.

The pad is never reported as empty while an object presses it.
"""

import os

import numpy as np
import pytest
from patterns import COLS, ROWS, box

from tactile_node import ContactStream
from tactile_node.contact.left_over import IDLE_FRAMES, LeftOver
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.contact.visibility import visibility_of
from tactile_node.shape.recognition import Shape, UnknownReason

LONG = bool(os.environ.get('TACTILE_LONG'))
TRIANGLE = (COLS >= 3) & (ROWS >= 3) & (COLS + ROWS <= 16)


def disc(radius, row=7.2, col=7.9):
    return (ROWS - row) ** 2 + (COLS - col) ** 2 <= radius ** 2


def states(masks, *, each=8, unit='Pa', seed=1):
    """Yield the pattern of each frame in which an object presses the pad.

    After a period without load, each mask in ``masks`` is pressed with 40 kPa for ``each`` frames.
    """
    rng, extractor = np.random.default_rng(seed), PatternExtractor(unit=unit)
    for mask in [np.zeros((16, 16), bool)] * 8 + list(masks):
        for _ in range(each):
            pattern = extractor.extract(40e3 * mask + 500 * rng.standard_normal(mask.shape))
            if mask.any():
                yield mask, pattern


HELD = {
    'ball that is let go slowly': [disc(radius) for radius in np.linspace(4.4, 0.5, 30)],
    'ball from 60 to 10 taxels': [disc(radius) for radius in np.linspace(4.4, 1.8, 30)],
    'triangle peeled off to its corner': [TRIANGLE & (ROWS + COLS <= last) for last in range(16, 5, -1)],
    'triangle peeled off to its side': [TRIANGLE & (ROWS + COLS >= first) for first in range(6, 17)],
    'triangle peeled off by rows': [TRIANGLE & (ROWS >= first) for first in range(3, 14)],
    'rod that gets shorter': [box(7, 3, 3, 10)] * 3 + [box(8, 3, 1, length) for length in range(10, 0, -1)],
    'tip that slides off the pad': [(COLS <= 15) & (COLS >= tip) & (abs(ROWS - 8) <= (COLS - tip) / 4)
                                    for tip in range(4, 16)],
    'tail that slides over the pad': [(COLS >= first) & (COLS <= first + 6) & (abs(ROWS - 8) <= (COLS - first) / 4)
                                       for first in range(-6, 16)],
    'ring that is torn': [disc(5) & ~disc(3.5)] * 3 + [disc(5) & ~disc(3.5) & (COLS > 11)] * 3
                         + [disc(5) & ~disc(3.5) & (COLS > 11) & (ROWS % 3 > 0)] * 3,
    'small object beside a larger one': [disc(3, 4, 4) | box(8, 6, 1, 5)] * 3 + [box(8, 6, 1, 5)] * 6,
    'place gripped again': [disc(4)] * 3 + [disc(4) & ((3 * ROWS + 7 * COLS) % 5 == 0)] * 3 + [disc(4), disc(2)] * 3,
}


@pytest.mark.parametrize(('name', 'unit'), [(name, unit) for i, name in enumerate(HELD)
                                            for j, unit in enumerate(('Pa', None)) if LONG or (i + j) % 2 == 0])
def test_a_pad_is_not_empty_while_something_presses_it(name, unit):
    """A gripper that opens when the pad is reported empty would drop the object.

    With TACTILE_LONG, each mask is tested with and without a pressure unit.
    """
    for mask, pattern in states(HELD[name], unit=unit):
        assert pattern.contacts or not pattern.pad_seen, f'{mask.sum()} taxels on'
        assert pattern.contacts or not visibility_of(pattern).pad_seen, f'{mask.sum()} taxels on'
        assert pattern.contacts or not visibility_of(pattern, smallest_contact=20).pad_seen, f'{mask.sum()} taxels on'


def test_a_pad_that_nothing_is_left_on_is_empty_at_once():
    free = np.zeros((16, 16))
    extractor, specks = PatternExtractor(), disc(4) & ((3 * ROWS + 7 * COLS) % 9 == 0)
    for mask in (free, disc(4), specks, specks):
        pattern = extractor.extract(9.0 * mask)
    assert not pattern.contacts and not pattern.pad_seen and pattern.is_left_over
    np.testing.assert_array_equal(pattern.hidden, specks)
    assert np.isnan(pattern.values[specks]).all() and (pattern.values[~specks] == 0).all()
    pattern = extractor.extract(free)
    assert pattern.pad_seen and not pattern.is_left_over and not pattern.hidden.any()


CLUMPS = {'square': box(6, 6, 3, 3), 'bar': box(5, 5, 2, 6), 'disc': disc(2.2), 'corner': TRIANGLE & disc(3.5, 4, 4)}


@pytest.mark.parametrize(('clump', 'frames', 'unit'), [
    pytest.param(clump, frames, unit, id=f'{name}-{frames}-{unit}') for i, (name, clump) in enumerate(CLUMPS.items())
    for j, frames in enumerate((1, 4, 13)) for k, unit in enumerate(('Pa', '1')) if LONG or (i + j + k) % 3 == 0])
def test_a_compact_clump_that_stays_on_after_a_release_is_left_over(clump, frames, unit):
    """The contact shrinks to the clump within ``frames`` frames.

    The remaining clump is then not a contact, and the pad is not reported as empty. With TACTILE_LONG, each clump is
    tested with each number of frames and each unit.
    """
    held = disc(5.2) | clump
    falling = [clump | disc(5.2 - 2.6 * k / frames) for k in range(1, frames)]
    rng, extractor = np.random.default_rng(5), PatternExtractor(unit=unit)
    level, noise = (1.0, 0.0) if unit == '1' else (40e3, 500.0)
    for number, mask in enumerate([held] * 30 + falling + [clump] * (200 if LONG else 50)):
        pattern = extractor.extract(level * mask + noise * rng.standard_normal(mask.shape))
        if number >= 30 + len(falling):
            assert not pattern.contacts and pattern.is_left_over and not pattern.pad_seen
        elif number < 30:
            assert pattern.contacts == 1 and not pattern.is_left_over


def test_an_object_that_is_taken_away_is_gone_within_0_3_s():
    """A planner that mistakes the remaining taxels for a held object would carry on without the object."""
    stream, clump = ContactStream(unit=None), box(6, 6, 4, 4)
    masks = [box(3, 3, 10, 10)] * 50 + [box(4, 4, 8, 8), box(5, 5, 6, 6)] + [clump] * 60 + [clump & False] * 3
    found = [stream.update(mask, 0.02 * number) for number, mask in enumerate(masks)]
    assert found[49].fused.recognition.shape is Shape.SQUARE
    for each in found[65:112]:
        assert each.fused.recognition.reason is UnknownReason.NOT_SEEN and not each.found.pattern.contacts
    assert found[-1].fused.recognition.shape is Shape.NONE and found[-1].found.pattern.pad_seen


RESTING = {'beyond it': box(9, 9, 4, 4), 'twice what was left': box(6, 6, 5, 5), 'beside it': box(12, 1, 3, 4)}


@pytest.mark.parametrize('resting', RESTING.values(), ids=RESTING)
def test_a_light_object_at_the_place_of_a_released_one_is_a_contact(resting):
    """A planner that sees no contact would drop the object."""
    extractor, clump = PatternExtractor(), box(6, 6, 3, 3)
    for mask in [disc(5.2)] * 20 + [clump] * 10 + [clump | resting] * 50:
        pattern = extractor.extract(mask)
    assert pattern.contacts and pattern.mask[resting].all()


@pytest.mark.parametrize('seen', [1, 2])
def test_a_contact_with_most_of_its_rows_lost_is_not_left_over(seen):
    extractor, held = PatternExtractor(unit='Pa'), box(3, 3, 8, 8)
    values = 40e3 * held + 500 * np.random.default_rng(6).standard_normal(held.shape)
    for number in range(40):
        pattern = extractor.extract(np.where((number >= 20) & (ROWS < 11 - seen), np.nan, values))
    assert pattern.contacts == 1 and not pattern.is_left_over
    np.testing.assert_array_equal(pattern.mask, held & (ROWS >= 11 - seen))


def test_a_taxel_begins_again_after_it_was_off_for_long_enough():
    free, specks = np.zeros((16, 16), bool), np.isin(16 * ROWS + COLS, [34, 52, 66])
    for idle, is_left in ((IDLE_FRAMES, True), (IDLE_FRAMES + 1, False)):
        found = LeftOver()
        found.update(disc(3, 3, 3))
        for _ in range(idle):
            assert not found.update(free).any()
        assert found.update(specks).any() == is_left


def test_single_arrays_and_patterns_of_all_pressed_taxels_have_no_left_over_taxels():
    assert not PatternExtractor().extract(np.eye(8)).hidden.any()
    extractor, specks = PatternExtractor(largest=False), np.isin(16 * ROWS + COLS, [34, 52, 66])
    for mask in (disc(3, 3, 3), specks):
        pattern = extractor.extract(9.0 * mask)
    np.testing.assert_array_equal(pattern.mask, specks)
    assert not pattern.hidden.any() and not pattern.is_left_over


@pytest.mark.ros
@pytest.mark.parametrize('specks', [[34], [34, 52, 66], list(range(34, 44))])
def test_left_over_taxels_arrive_in_a_message_that_is_accepted(specks):
    """The message gives the reason NOT_SEEN, and never EMPTY.

    Left-over taxels are marked FAULTY and have no value. Each taxel in the message keeps its noise.
    """
    pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')
    from tactile_node.pose.pipeline import FoundContact, Taxels
    from tactile_node.ros.contact_messages import (
        PadContact,
        PadFrame,
        contact_message,
        pad_contact_of,
        taxel_array_message,
        taxel_values,
    )
    from tactile_node.ros.message_checks import check_contact, check_taxel_array
    from tactile_node.taxel_frame import TaxelFrame, TaxelStatus
    from tactile_skin.msg import Contact
    rng, extractor, stays = np.random.default_rng(4), PatternExtractor(unit='Pa'), np.isin(16 * ROWS + COLS, specks)
    status = np.full((16, 16), TaxelStatus.VALID, np.uint8)
    status[15, 15] = TaxelStatus.STALE
    for number, mask in enumerate([np.zeros((16, 16), bool)] * 40 + [box(1, 1, 8, 12)] * 5 + [stays] * 3):
        values = (40e3 * mask + 500 * rng.standard_normal(mask.shape)).astype(np.float32)
        values[15, 15] = np.nan
        frame = PadFrame.of(TaxelFrame(1.7e9 + number / 50, number, values, status, missing_can_frames=0),
                            Taxels(0.002, 'Pa'), 'pad')
        taxels = taxel_array_message(frame)
        assert check_taxel_array(taxels) is None
        pattern = extractor.extract(taxel_values(taxels))
        message = contact_message(PadContact(frame, FoundContact.of(pattern, frame.taxels)))
        assert check_contact(message) is None
    assert message.state == Contact.NOT_SEEN and not message.pad_seen and not message.contacts
    codes = np.frombuffer(message.status, np.uint8).reshape(16, 16)
    assert (codes[stays] == TaxelStatus.FAULTY).all() and codes[15, 15] == TaxelStatus.STALE
    arrived = pad_contact_of(message).found.pattern
    np.testing.assert_array_equal(arrived.hidden, pattern.hidden)
    np.testing.assert_allclose(arrived.noise, pattern.noise, rtol=1e-6)
    assert 300 < np.median(arrived.noise) < 700


def test_a_changed_threshold_keeps_left_over_taxels_and_hides_no_current_contact():
    specks = disc(4) & ((3 * ROWS + 7 * COLS) % 9 == 0)
    frames = 20e3 * disc(4), 20e3 * disc(4) + 30e3 * disc(1.5), 50e3 * specks
    whole, hill, rest = frames
    for last, is_left in ((hill, False), (rest, True)):
        extractor = PatternExtractor(PressThresholds(10e3, 8e3), unit='Pa')
        for frame in [whole] * 5 + [last] * 5:
            before = extractor.extract(frame)
        assert before.is_left_over is is_left and before.pad_seen is not is_left
        extractor.set_thresholds(PressThresholds(30e3, 25e3))
        for _ in range(5):
            after = extractor.extract(last)
            assert after.is_left_over is is_left and after.pad_seen is not is_left
            assert np.array_equal(after.mask, last > 25e3) is not is_left


def test_a_higher_threshold_releases_taxels_that_never_reached_it():
    extractor, frame = PatternExtractor(PressThresholds(10e3, 8e3), unit='Pa'), 20e3 * disc(4)
    assert extractor.extract(frame).contacts == 1
    extractor.set_thresholds(PressThresholds(30e3, 15e3))
    assert extractor.extract(frame).contacts == 0, 'only the lower threshold would make this a contact'
