"""Visibility states how much of the pad, and of a contact's surroundings, a frame shows."""

import numpy as np
import pytest

from tactile_node.contact.neighbours import pad_seen
from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.contact.visibility import visibility_of

NAN = np.nan


def visibility(frame, smallest=4, **masks):
    pattern = PatternExtractor(PressThresholds(5, 3)).extract(np.array(frame, float), **masks)
    return visibility_of(pattern, smallest)


@pytest.mark.parametrize(('hidden', 'least'), [
    # The hidden taxels form a square in the first case, and a bar in the second.
    ([(2, 2), (2, 3), (3, 2), (3, 3)], 4), ([(2, 0), (2, 1), (2, 2), (2, 3)], 4),
    # The hidden taxels form an oblique line in the first case, and a group of three with a single taxel in the second.
    ([(0, 0), (1, 1), (2, 2), (3, 3)], 4), ([(0, 0), (0, 1), (0, 2), (4, 4)], 3),
    ([(0, 0), (0, 2), (2, 0), (2, 2), (4, 4)], 1)])  # The hidden taxels are scattered.
def test_a_pad_is_seen_unless_a_group_of_hidden_taxels_has_room_for_the_smallest_contact(hidden, least):
    taxels, nothing = np.zeros((6, 6), bool), np.zeros((6, 6), bool)
    for place in hidden:
        taxels[place] = True
    for smallest in range(1, 8):
        assert pad_seen(taxels, nothing, smallest) is (smallest > least)
    assert pad_seen(nothing, nothing)
    assert not pad_seen(np.ones((1, 2), bool), np.zeros((1, 2), bool)), 'no taxel is visible'


def test_places_without_a_taxel_hide_nothing():
    unmapped = np.zeros((6, 6), bool)
    unmapped[2:5, 2:5] = True
    frame = np.where(unmapped, NAN, 0.0)
    assert not visibility(frame).pad_seen
    found = visibility(frame, unmapped=unmapped)
    assert found.pad_seen and not found.hidden and not found.largest_hidden
    assert not visibility(np.full((3, 3), NAN), unmapped=np.ones((3, 3), bool)).pad_seen, 'no taxel at all'


def test_hidden_taxels_in_a_contact_and_around_it():
    frame = np.zeros((9, 9))
    frame[2:7, 2:6] = 9
    assert visibility(frame)[3:6] == (0, 0, 22)
    # One hidden taxel lies within the contact, two lie at its corners, and one lies far away.
    frame[4, 3] = frame[1, 1] = frame[7, 6] = frame[0, 8] = NAN
    found = visibility(frame)
    assert (found.hidden, found.hidden_in_contact, found.hidden_in_ring, found.ring) == (4, 1, 2, 22)
    assert found.largest_hidden == 1 and not found.at_edge and found.pad_seen
    assert not found.outline_hidden, 'single dead taxels leave no room for a further part of the contact'


@pytest.mark.parametrize(('hidden', 'expected'), [
    ([(2, 6)], False), ([(2, 6), (3, 6)], True),  # Two hidden taxels are a tenth of the contact's twenty taxels.
    ([(2, 6), (2, 7)], True),  # One of the two hidden taxels lies in the ring.
    ([(2, 8), (3, 8), (4, 8), (5, 8)], False),  # These hidden taxels lie beyond the ring.
    ([(1, 1), (7, 6), (8, 8), (0, 4), (4, 3)], False)])  # The hidden taxels are scattered.
def test_a_contact_may_continue_under_a_group_of_hidden_taxels_with_room_for_one(hidden, expected):
    frame = np.zeros((9, 9))
    frame[2:7, 2:6] = 9
    for place in hidden:
        frame[place] = NAN
    assert visibility(frame).outline_hidden is expected


def test_saturated_taxels_in_a_contact_and_around_it():
    frame = np.zeros((6, 6))
    frame[2:4, 2:4] = 9
    saturated = np.zeros((6, 6), bool)
    saturated[2, 2:5] = saturated[0, 0] = True
    found = visibility(frame, saturated=saturated)
    assert (found.saturated_in_contact, found.saturated_in_ring) == (2, 1)


def test_four_hidden_taxels_beside_a_large_contact_are_room_enough():
    frame = np.zeros((16, 16))
    frame[2:10, 2:10] = 9
    frame[2:5, 10] = NAN
    assert not visibility(frame).outline_hidden, 'three of 64 taxels are too few'
    frame[5, 10] = NAN
    assert visibility(frame).outline_hidden


def test_a_group_of_hidden_taxels_within_a_contact_is_not_known():
    frame = np.zeros((12, 12))
    frame[2:10, 2:10] = 9
    frame[5, 5] = NAN
    assert not visibility(frame).inside_hidden
    frame[4:6, 4:6] = NAN
    assert visibility(frame).inside_hidden and not visibility(frame).outline_hidden
