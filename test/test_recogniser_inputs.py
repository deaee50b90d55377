"""Inputs of the recogniser: unusual contacts, and how well each shape covers a patch."""

import numpy as np
import pytest

from tactile_node import Recogniser, find_contact
from tactile_node.contact.pattern import of_contact
from tactile_node.shape.invariants import LIKENESS_COUNT, describe_all
from tactile_node.shape.patch import SIDE, joined
from tactile_node.shape.recognition import Shape, UnknownReason
from tactile_node.simulator.figures import coverage
from tactile_node.simulator.world import CLASSES, random_contact
from training.ground_truth.seeds import Purpose, generator


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


def test_the_largest_contact_does_not_count_as_specks_around_the_second(recogniser):
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


FIGURES = ('rectangle', 'square', 'triangle', 'circle')  #: Figures whose overlaps are the first four inputs.
OF_CLASS = dict(zip(CLASSES, ('circle', 'square', 'rectangle', 'triangle', 'triangle')))

ALSO = {'square': ('rectangle',)}  #: Other figures that can also cover a shape of the class.


def numbers_of(levels: np.ndarray) -> np.ndarray:
    """Return the recogniser's inputs for the covered fractions (K, SIDE, SIDE)."""
    return describe_all(levels, np.zeros(levels.shape), np.ones(len(levels)))[:, -LIKENESS_COUNT:]


@pytest.mark.parametrize('shape', CLASSES)
def test_a_shape_is_covered_by_its_own_figure(shape):
    rng = generator(Purpose.TEST, 21)
    covered = np.array([coverage(random_contact(rng, shape, 60, SIDE, SIDE), SIDE, SIDE) for _ in range(20)])
    overlaps = numbers_of(covered)[:, :4]
    own = FIGURES.index(OF_CLASS[shape])
    others = [k for k, figure in enumerate(FIGURES) if figure not in (OF_CLASS[shape], *ALSO.get(shape, ()))]
    assert (overlaps[:, own] > 0.9).all()
    assert (overlaps[:, others].max(1) < 0.85).all()
