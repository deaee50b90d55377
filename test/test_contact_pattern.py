"""Tests for finding the contact pattern in taxel values."""

import numpy as np
import pytest

from tactile_node.contact.pattern import ContactPattern, PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.errors import ConfigurationError, InputError

NAN = np.nan


def extract(*frames, **options):
    """Return the pattern after the last of ``frames``, with a press threshold of 5 and a release threshold of 3."""
    extractor = PatternExtractor(PressThresholds(5, 3), **options)
    return [extractor.extract(np.array(frame, float)) for frame in frames][-1]


def test_hysteresis():
    assert extract([[4.9]]).mask.tolist() == [[False]]
    assert extract([[5]]).mask.tolist() == [[True]]
    assert extract([[5]], [[3]]).mask.tolist() == [[True]], 'a pressed taxel stays pressed at the release threshold'
    assert extract([[5]], [[2.9]], [[4]]).mask.tolist() == [[False]], 'a released taxel must reach 5 to be pressed'


@pytest.mark.parametrize('invalid', [NAN, np.inf, -np.inf])
def test_invalid_taxel_is_out_but_keeps_its_state(invalid):
    assert extract([[5]], [[invalid]]).mask.tolist() == [[False]]
    assert extract([[5]], [[invalid]], [[4]]).mask.tolist() == [[True]]
    assert extract([[invalid]], [[4]]).mask.tolist() == [[False]]
    assert np.isnan(extract([[invalid]]).values).all()


def test_largest_of_several_contacts():
    pattern = extract([[9, 0, 9, 9], [0, 0, 0, 9], [9, 0, 0, 0]])
    assert pattern.contacts == 3
    assert pattern.mask.tolist() == [[False, False, True, True], [False, False, False, True], [False] * 4]


def test_contacts_are_numbered_by_their_size():
    pattern = extract([[9, 0, 9, 9, 9], [0, 0, 0, 0, 0], [9, 9, 0, 0, 0]])
    assert pattern.labels.tolist() == [[3, 0, 1, 1, 1], [0, 0, 0, 0, 0], [2, 2, 0, 0, 0]]
    assert (pattern.contacts, pattern.sizes, pattern.labels.dtype) == (3, (3, 2, 1), np.uint8)
    assert (extract([[0]]).sizes, extract([[9]]).sizes) == ((), (1,))


@pytest.mark.parametrize('hidden', [1, 2, 7])
def test_rows_that_are_not_seen_tear_no_contact_apart(hidden):
    """If hidden rows split the contact, a planner would look for two objects and miss the force on one half."""
    frame = np.zeros((hidden + 8, 8))
    frame[2:-2, 2:6] = 9
    frame[4:4 + hidden] = NAN
    for turned in (frame, frame.T):
        pattern = extract(turned)
        assert (pattern.contacts, pattern.sizes) == (1, (16,))
        np.testing.assert_array_equal(pattern.mask, np.nan_to_num(turned) == 9)


def test_hidden_taxels_join_only_contacts_that_face_each_other():
    frame = np.zeros((5, 9))
    frame[:2, :3] = frame[3:, 6:] = 9
    frame[2] = NAN
    assert extract(frame).contacts == 2
    frame[2, 4] = 0
    frame[3:, :3] = 9
    assert extract(frame).sizes == (12, 6)


def test_hidden_saturated_and_unmapped_taxels():
    frame, unmapped = np.array([[9, NAN, NAN], [np.inf, 0, 9]]), np.array([[0, 0, 1], [0, 0, 0]], bool)
    saturated = np.array([[1, 1, 0], [0, 0, 0]], bool)
    pattern = PatternExtractor(PressThresholds(5, 3)).extract(frame, saturated=saturated, unmapped=unmapped)
    assert pattern.hidden.tolist() == [[False, True, False], [True, False, False]]
    assert pattern.saturated.tolist() == [[True, False, False], [False] * 3], 'a missing value gives no bound'
    np.testing.assert_array_equal(pattern.unmapped, unmapped)
    whole = extract(frame)
    assert whole.hidden.sum() == 3 and not whole.saturated.any() and not whole.unmapped.any()


@pytest.mark.parametrize('wrong', [np.zeros((1, 1), bool), np.zeros((2, 2)), [[True]]])
def test_masks_of_another_shape_or_kind_are_refused(wrong):
    for name in ('saturated', 'unmapped'):
        with pytest.raises(InputError, match=name):
            PatternExtractor(PressThresholds(5, 3)).extract(np.zeros((2, 2)), **{name: wrong})


def test_a_pattern_of_a_mask_equals_the_pattern_of_the_extractor():
    frame = np.array([[9, 0, NAN], [9, 9, 0]])
    found = extract(frame)
    made = ContactPattern.of(found.mask, found.values)
    for name, array in made._asdict().items():
        np.testing.assert_array_equal(array, getattr(found, name), err_msg=name)


@pytest.mark.parametrize('opening', [(0, 2), (1, 1), (3, 3)])
def test_invalid_taxels_beside_an_open_one_are_not_filled(opening):
    frame = np.full((5, 6), 9.0)
    frame[1:3, 2:4] = NAN
    frame[opening] = 0
    np.testing.assert_array_equal(extract(frame).mask, frame == 9)


def test_a_frame_of_another_shape_starts_again():
    extractor = PatternExtractor(PressThresholds(5, 3))
    extractor.extract(np.full((2, 2), 9.0))
    assert not extractor.extract(np.full((2, 3), 4.0)).mask.any()
    extractor.extract(np.full((2, 3), 9.0))
    assert extractor.extract(np.full((2, 3), 4.0)).mask.all()


@pytest.mark.parametrize('press, release', [(0, 0), (1, 2), (NAN, 1), (1, NAN), (np.inf, 1), (-1, -2)])
def test_wrong_thresholds_are_refused(press, release):
    with pytest.raises(ConfigurationError, match='0 < release <= press'):
        PressThresholds(press, release)


@pytest.mark.parametrize('options, press, release', [
    ({}, 24.0, 16.0), ({'press': 0.1}, 8.0, 8.0), ({'press': 0.5, 'release': 0.25}, 40.0, 20.0)])
def test_thresholds_of_a_full_scale(options, press, release):
    assert PressThresholds.of_full_scale(80.0, **options) == PressThresholds(press, release)


@pytest.mark.parametrize('largest', [True, False])
def test_a_bool_frame_is_the_pressed_taxels(largest):
    frame = np.array([[1, 0, 1, 1]], bool)
    pattern = PatternExtractor(PressThresholds(5, 3), largest=largest).extract(frame)
    assert pattern.mask.tolist() == [[not largest, False, True, True]] and pattern.contacts == 2
    assert pattern.values.tolist() == [[1.0, 0.0, 1.0, 1.0]] and frame.flags.writeable


@pytest.mark.parametrize('frame', [np.zeros(3), np.zeros((1, 2, 3)), np.zeros((0, 3)),
                                   np.zeros((2, 2), complex)])
def test_an_array_that_is_not_a_frame_is_refused(frame):
    with pytest.raises(InputError, match='rows, cols'):
        PatternExtractor(PressThresholds(5, 3)).extract(frame)
