"""The outline of a contact excludes taxels that read much but lie beside the contact, and no part of the contact."""

import numpy as np
import pytest

from tactile_node import Recogniser
from tactile_node.contact.pattern import ContactPattern
from tactile_node.shape.recognition import Shape
from tactile_node.shape.steepest_outline import steepest_outline
from tactile_node.shape.support import SURE

PAD = (10, 16)


def block(side: int = 6, row: int = 2, col: int = 4) -> np.ndarray:
    taxels = np.zeros(PAD, bool)
    taxels[row:row + side, col:col + side] = True
    return taxels


def with_spill(rng: np.random.Generator) -> np.ndarray:
    """Return a frame of a block of 6x6 taxels with uneven gains. Some taxels beside the block read 30 to 50 %."""
    read = rng.uniform(0.0, 0.1, PAD)
    for row, col in ((1, 10), (6, 10), (7, 1)):  # groups of 2x3 taxels beside the block
        read[row:row + 2, col:col + 3] = rng.uniform(0.3, 0.5, (2, 3))
    read[block()] = 1.0
    return 0.7 * read * np.exp(0.15 * rng.standard_normal(PAD))


def overlap(found: np.ndarray, wanted: np.ndarray) -> float:
    return np.count_nonzero(found & wanted) / np.count_nonzero(found | wanted)


def test_taxels_beside_a_block_are_left_out():
    for seed in range(20):
        values = with_spill(np.random.default_rng(seed))
        wide = values > 0.2
        found = steepest_outline(values, wide)
        assert not (found & ~wide).any()
        assert overlap(found, block()) > overlap(wide, block()) + 0.1


def test_a_block_with_such_taxels_is_recognised():
    recogniser = Recogniser()
    patterns = [ContactPattern.of(values > 0.2, values)
                for values in (with_spill(np.random.default_rng(seed)) for seed in range(20))]
    assert sum(recogniser.recognise(pattern).shape is Shape.SQUARE for pattern in patterns) >= 16


@pytest.mark.parametrize('weaker', [0.5, 0.6, 0.75])
def test_a_part_that_presses_less_stays(weaker):
    """An L whose second arm presses less is not cut down to its first arm, which is a rectangle."""
    arms = np.zeros((16, 16))
    arms[3:13, 3:7] = 1.0
    arms[9:13, 7:13] = weaker
    for seed in range(10):
        values = arms * np.exp(0.1 * np.random.default_rng(seed).standard_normal(arms.shape))
        assert overlap(steepest_outline(values, arms > 0), arms > 0) > 0.95


def test_a_tilted_block_stays_whole():
    tilt = np.linspace(0.5, 1.5, PAD[1])
    values = np.where(block(8, 1, 4), tilt, 0.0)
    assert overlap(steepest_outline(values, values > 0), values > 0) > 0.9


def test_small_and_on_off_contacts_keep_their_outline():
    small = np.where(block(5), 1.0, 0.0)
    small[3, 4:9] = 0.5
    for values in (small, block(8).astype(float)):
        mask = values > 0
        assert steepest_outline(values, mask) is mask


def test_taxels_without_a_value_do_not_end_a_contact():
    values = with_spill(np.random.default_rng(0))
    wide = values > 0.2
    values[4, 4:10] = np.nan  # a dead row through the block
    found = steepest_outline(values, wide)
    assert found[3, 4:10].sum() >= 4 and found[5, 4:10].sum() >= 4


def test_a_contact_without_any_value_keeps_its_outline():
    mask = block()
    assert steepest_outline(np.full(PAD, np.nan), mask) is mask


def torn_rectangle(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return a rectangle of 6x10 taxels with uneven gains and a silent column, and its taxels."""
    taxels = np.zeros((12, 16), bool)
    taxels[3:9, 3:13] = True
    taxels[:, 10] = False
    return np.where(taxels, np.exp(0.25 * rng.standard_normal(taxels.shape)), 0.0), taxels


def test_the_larger_piece_of_a_torn_rectangle_is_no_square():
    recogniser = Recogniser()
    for seed in range(20):
        values, taxels = torn_rectangle(np.random.default_rng(seed))
        values[:, 11:13] *= 0.6  # the smaller piece presses less
        found = recogniser.recognise(ContactPattern.of(taxels, values))
        assert found.shape is not Shape.SQUARE


def test_a_name_that_only_the_steepest_outline_shows_is_not_sure():
    recogniser = Recogniser()
    for seed in range(20):
        values = with_spill(np.random.default_rng(seed))
        found = recogniser.recognise(ContactPattern.of(values > 0.2, values))
        assert found.confidence < SURE
