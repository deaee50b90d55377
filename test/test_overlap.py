"""Largest overlap of a figure with the five shapes, compared with known values and a search over a fine grid."""

import os

import numpy as np
import pytest

from tactile_node.simulator.world import CLASSES, random_contact
from training.ground_truth.overlap import Limits, best_overlap, overlaps
from training.ground_truth.raster import as_raster, coarser

NEAR = 0.006  #: Error bound of best_overlap, plus the error of the grid.
SIDE = 400
LONG = bool(os.environ.get('TACTILE_LONG'))


def inside(function, reach=2.0):
    """Return a mask over a fine grid, which is True where ``function`` is true."""
    place = (np.arange(SIDE) + 0.5) / SIDE * 2 * reach - reach
    return function(*np.meshgrid(place, place))


def iou(a, b):
    return np.count_nonzero(a & b) / np.count_nonzero(a | b)


@pytest.mark.parametrize('shape', CLASSES)
def test_each_shape_overlaps_itself(shape):
    rng = np.random.default_rng(7)
    for _ in range(8 if LONG else 1):
        found = best_overlap(random_contact(rng, shape, 80.0).outline(128))
        assert found.shape == shape
        assert 0.99 <= found.iou <= 1.005


@pytest.mark.slow
@pytest.mark.parametrize('ratio', [1.6, pytest.param(1.1, marks=pytest.mark.long)])
def test_an_ellipse_is_between_circle_and_rectangle(ratio):
    figure = inside(lambda x, y: (x / ratio) ** 2 + y ** 2 <= 0.5)
    half = np.linspace(0.4, 1.9, 76)
    circle = max(iou(figure, inside(lambda x, y, r=r: x * x + y * y <= r * r)) for r in half)
    rectangle = max(iou(figure, inside(lambda x, y, a=a, b=b: (abs(x) <= a) & (abs(y) <= b)))
                    for a in half for b in half[:20])
    found = best_overlap(figure)
    assert found.shape == ('circle' if circle > rectangle else 'rectangle')
    assert found.iou == pytest.approx(max(circle, rectangle), abs=NEAR)


@pytest.mark.slow
def test_a_figure_may_turn_grow_and_have_holes_and_pieces():
    ell = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 4], [0, 4]], float)
    expected = best_overlap(ell)
    for angle, scale, mirrored in ((4, 0.01, -1), *LONG * ((0.3, 1, 1), (1.9, 30, 1))):
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        found = best_overlap(ell * (mirrored, 1) @ turn * scale + 5)
        assert found.iou == pytest.approx(expected.iou, abs=0.01)
    ring = inside(lambda x, y: (x * x + y * y <= 1) & (x * x + y * y >= 0.25))
    assert best_overlap(ring).iou == pytest.approx(0.75, abs=NEAR)
    apart = inside(lambda x, y: (abs(x) <= 1.5) & (abs(y) <= 0.5) & (abs(x) >= 0.15))
    assert best_overlap(apart) == ('rectangle', pytest.approx(0.9, abs=NEAR))


def test_limits_say_what_is_a_rectangle():
    narrow = Limits(ratio=(1, 1.5), legs=(1.5, 2.5), apex=(40, 75))
    # The best rectangle of width 1.5 * height on 3 x 1 has this height, from d/dh 1.5 h / (3 + 1.5 h² - 1.5 h) = 0.
    height = np.sqrt(2)
    best = 1.5 * height / (3 + 1.5 * height ** 2 - 1.5 * height)
    assert 0.5 < overlaps(np.ones((40, 120), bool), narrow)['rectangle'] < best + NEAR
    assert best_overlap(np.ones((40, 120), bool), narrow).iou < 0.75
    assert best_overlap(np.ones((40, 120), bool)).iou > 0.99


def test_a_raster_keeps_the_area():
    triangle = np.array([[0, 0], [8, 0], [0, 4]], float)
    for corners in (triangle, triangle[::-1]):  # The corners are given clockwise and counterclockwise.
        raster = as_raster(corners, cells=40)
        assert raster.shape == (20, 40)
        assert raster.sum() == pytest.approx(16 * 25, rel=1e-9)
    assert as_raster(np.eye(7) > 0, cells=40).sum() * (7 / 40) ** 2 == pytest.approx(7)
    assert coarser(np.ones((4, 5)), 2).tolist() == [[1, 1, 0.5], [1, 1, 0.5]]
