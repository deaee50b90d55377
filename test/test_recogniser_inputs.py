"""What the recogniser makes of torn contacts, broken taxels, baselines and contacts beside each other."""

import numpy as np
import pytest

from tactile_node import Recogniser, find_contact, fit_shape
from tactile_node.contact.pattern import of_contact
from tactile_node.shape.patch import HIGHEST_LEVEL, joined, make_patch
from tactile_node.shape.recognition import Shape, UnknownReason


@pytest.fixture(scope='module')
def recogniser():
    return Recogniser()


@pytest.mark.parametrize('rows', [3, 4, 5])
def test_hidden_rows_within_one_contact_take_no_piece_of_it_because_of_another_contact(recogniser, rows):
    values = np.zeros((20, 30))
    values[3:15, 5:11] = 50e3
    values[7:7 + rows] = np.nan
    alone = find_contact(values)
    values[15:19, 20:24] = 50e3
    beside = find_contact(values)
    assert (joined(beside) == joined(alone)).all() and (joined(beside) >= beside.mask).all()
    assert recogniser.recognise(beside).shape is recogniser.recognise(alone).shape


@pytest.mark.parametrize('sent', [-32768.0, -1e9])
def test_what_one_broken_taxel_sends_below_zero_changes_no_shape(recogniser, sent):
    values = np.random.default_rng(1).normal(0, 2, (20, 20)) * 100
    values[5:14, 5:14] += 30e3
    whole = recogniser.recognise(find_contact(values))
    values[8, 8] = sent
    found = recogniser.recognise(find_contact(values))
    assert whole.shape is found.shape is Shape.SQUARE and found.confidence > 0.9


def test_levels_stay_within_what_training_keeps():
    values = np.full((12, 12), 0.0)
    values[3:9, 3:9] = 10e3
    values[5, 5] = 90e3
    level = make_patch(values, values > 5e3).level
    assert level.max() == pytest.approx(HIGHEST_LEVEL) and level.min() >= 0


@pytest.mark.parametrize('baseline', [-1000, 300, 4000])
def test_an_array_without_a_unit_may_have_a_baseline(recogniser, baseline):
    """Counts of a converter that nothing has been taken off."""
    counts = np.rint(np.random.default_rng(2).normal(0, 1, (16, 24)))
    counts[5:10, 6:15] += 100
    plain, raised = (find_contact(counts + rest, unit=None) for rest in (0, baseline))
    assert recogniser.recognise(plain).shape is recogniser.recognise(raised).shape is Shape.RECTANGLE
    lengths = [fit_shape(contact, Shape.RECTANGLE).dimensions for contact in (plain, raised)]
    assert lengths[1] == pytest.approx(lengths[0], abs=0.1)


def test_the_largest_contact_is_no_specks_around_the_second(recogniser):
    triangle = np.zeros((24, 24))
    for row in range(4):
        triangle[14 + row, 3:7 - row] = 1
    beside = triangle.copy()
    beside[3:11, 12:20] = 1
    alone = recogniser.recognise(find_contact(triangle, unit='1'))
    second = of_contact(find_contact(beside, unit='1'), 2)
    assert recogniser.recognise(second._replace(contacts=1)).shape is alone.shape is not Shape.UNKNOWN


def test_specks_between_hidden_rows_are_not_seen_instead_of_unfamiliar(recogniser):
    values = np.zeros((16, 16))
    values[3:10, 4:11] = 50e3
    values[3:7] = values[8:12] = np.nan
    found = recogniser.recognise(find_contact(values))
    assert (found.shape, found.reason) == (Shape.UNKNOWN, UnknownReason.NOT_SEEN)
