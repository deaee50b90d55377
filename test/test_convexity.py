"""Tests for the check that a contact fills its convex hull, as contacts of the five shapes do."""

import numpy as np
import pytest

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.shape.methods import make_recogniser
from tactile_node.shape.recognition import Shape
from tactile_node.shape.support import is_convex

ROWS, COLS = np.mgrid[:28, :40]


def ring(outer, inner, row=13, col=20):
    away = np.hypot(ROWS - row, COLS - col)
    return (away <= outer) & (away >= inner)


def bar(row, col, rows, cols):
    return (ROWS >= row) & (ROWS < row + rows) & (COLS >= col) & (COLS < col + cols)


HOOK = bar(12, 4, 3, 30) | bar(3, 31, 9, 3)
BOW = ring(22, 19, row=24) & (ROWS < 14)
FORK = bar(12, 4, 3, 24) | (abs(ROWS - 13 - (COLS - 20) * 0.6) < 2) & (COLS > 20) & (COLS < 34)
SCATTERED = ring(3, 0, 6, 10) | ring(3, 0, 20, 12) | ring(3, 0, 14, 24)
TRIANGLE = (ROWS >= 4) & (COLS >= 6) & (ROWS + COLS <= 30)
OBLIQUE = (abs(ROWS - 13 - (COLS - 20) * 0.5) < 2.5) & (COLS > 4) & (COLS < 36)


def convex(taxels):
    return is_convex(taxels.astype(float), taxels)


@pytest.mark.parametrize('taxels', [HOOK, BOW, FORK, SCATTERED], ids=['hook', 'bow', 'fork', 'scattered'])
def test_bent_and_scattered_contacts_are_not_convex(taxels):
    assert not convex(taxels)
    assert not convex(taxels.T) and not convex(taxels[::-1, ::-1])


@pytest.mark.parametrize('taxels', [ring(9, 0), ring(9, 6), TRIANGLE, OBLIQUE, bar(12, 0, 3, 40), bar(5, 5, 2, 2),
                                    bar(12, 7, 1, 1)],
                         ids=['disc', 'ring', 'triangle', 'oblique bar', 'bar across', 'four taxels', 'one taxel'])
def test_the_five_shapes_are_convex(taxels):
    assert convex(taxels) and convex(taxels.T)


def test_a_rim_cut_by_one_edge_of_the_pad_encloses_the_same_taxels():
    half = ring(9, 7, row=0)
    assert convex(half)
    assert not convex(np.roll(half, 6, axis=0)), 'away from the edge, the same arc is a bow'


def test_pressures_below_the_mask_close_a_rim():
    whole = ring(9, 7)
    values = np.where(whole, np.where(COLS > 20, 1.0, 0.35), 0.0)
    mask = whole & (COLS > 20)
    assert is_convex(values, mask)
    assert not is_convex(np.where(mask, values, 0.0), mask)


def test_unseen_taxels_are_not_a_notch():
    values = bar(5, 5, 12, 12).astype(float)
    values[5:14, 9:17] = np.nan
    assert is_convex(values, values > 0)
    values[5:14, 9:17] = 0
    assert not is_convex(values, values > 0)


def test_equal_parts_form_one_contact_and_a_large_part_is_recognised_beside_a_small_one():
    recogniser = make_recogniser()
    parts = ring(4, 0, 8, 10) | ring(4, 0, 8, 20) | ring(4, 0, 17, 15)
    large = bar(4, 5, 14, 14) | bar(9, 21, 4, 4)
    names = [recogniser.recognise(PatternExtractor(unit='Pa').extract(taxels * 3e4)).shape for taxels in (parts, large)]
    assert names == [Shape.UNKNOWN, Shape.SQUARE]
