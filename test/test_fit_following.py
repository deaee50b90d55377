"""Tests that compare a fit that continues from the previous frame with a new search in each frame.

A contact-mechanics solver computes the pressures, and its contact set is the ground truth. The contact slides, turns,
grows, is pressed harder, loses taxels, and jumps.
"""

import os
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from tactile_node import find_contact
from tactile_node.pose.fit import fit_shape
from tactile_node.pose.outline_fit import SEARCH_PERIOD, OutlineFit
from tactile_node.shape.recognition import Shape
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.world import Contact, random_contact
from training.ground_truth.indenters import ball, flat_punch
from training.ground_truth.layer import measured, sample, stress_field
from training.ground_truth.mechanics import solve

PUNCHES = {
    'circle': (0.564,), 'square': (1.0,), 'rectangle': (1.4, 0.714), 'right_triangle': (1.73, 1.155, 1.0),
    'isosceles_triangle': (1.41, 1.41)}
LONG = bool(os.environ.get('TACTILE_LONG'))
PERIOD, SIDE, MIDDLE, DEPTH = 0.02, 32, 14.0, 0.6
FRAMES = 40 if LONG else 30
INSIDE = 5.99  # The 95 % quantile of chi squared for the two coordinates of the centre.


class Moment(NamedTuple):
    """Place, size and load of the contact in one frame, with lengths in pitches."""

    x: float = 0.0  # Distance from the middle of the pad along x.
    y: float = 0.0
    angle: float = 0.4
    area: float = 60.0
    load: float = 1.0
    dead: float = 0.0
    line: int = -1  # Row without values, or -1 if all rows have values.


def path(change: Callable[[int], Moment]) -> list[Moment]:
    return [change(number) for number in range(FRAMES)]


WAYS = {
    'rests': path(lambda i: Moment()),
    'slides by 0.2 pitch a frame': path(lambda i: Moment(x=0.2 * i - 4, y=0.1 * i - 2)),
    'slides by 0.5 pitch a frame': path(lambda i: Moment(x=0.5 * (i % 20) - 5, y=0.1)),
    'turns by 2 degrees a frame': path(lambda i: Moment(angle=0.4 + 0.035 * i)),
    'grows': path(lambda i: Moment(area=40 + i)),
    'is pressed harder': path(lambda i: Moment(load=0.1 + 0.9 * i / FRAMES)),
    'loses and regains taxels': path(lambda i: Moment(dead=0.03 * (i // 5 % 2), line=14 if i % 7 == 3 else -1)),
    'jumps': path(lambda i: Moment(x=3.0 * (i >= 20), angle=0.4 + 0.6 * (i >= 20))),
    'is pressed over the edge': path(lambda i: Moment(x=-6 - 0.2 * i)),
}


@cache
def pressed(shape: str, area: float):
    """Return the stress field and the centre of its contact set in the frame of the field [pitches]."""
    solution = solve(flat_punch(Contact(shape, PUNCHES[shape], 0.0, 0.0), 0.03, 0.12), (0.05, 0.03))
    rows, cols = np.nonzero(solution.contact)
    middle = np.array(solution.origin) + np.array((cols.mean(), rows.mean())) * solution.cell
    return stress_field(solution, area, DEPTH), np.sqrt(area) * middle


class Followed(NamedTuple):
    """Results of the fits in n frames.

    ``apart`` (n, 2) is the offset of the fitted centre from the true centre [pitches]. ``inside`` (n,) is True if the
    95 % region contains the true centre.
    """

    apart: np.ndarray
    inside: np.ndarray


def fits_of(shape: str, moments: list[Moment], outlines: dict[Shape, OutlineFit] | None) -> Followed:
    rng, apart, inside = np.random.default_rng(20261125), [], []
    for number, moment in enumerate(moments):
        field, middle = pressed(shape, moment.area)
        stress = sample(field, MIDDLE + moment.x, MIDDLE + moment.y, moment.angle, SIDE, SIDE)
        frame = moment.load * measured(stress, 0.4, rng, noise=0.01 / moment.load, dead=moment.dead)
        if moment.line >= 0:
            frame[moment.line] = np.nan
        contact = find_contact(frame, unit=None)
        fit = fit_shape(contact.values, contact.mask, Shape(shape), outlines=outlines, stamp=number * PERIOD)
        cos, sin = np.cos(moment.angle), np.sin(moment.angle)
        true = np.array((MIDDLE + moment.x + cos * middle[0] - sin * middle[1],
                         MIDDLE + moment.y + sin * middle[0] + cos * middle[1]))
        apart.append(np.array(fit.centre) - true)
        inside.append(apart[-1] @ np.linalg.solve(fit.covariance[:2, :2], apart[-1]) < INSIDE)
    return Followed(np.array(apart), np.array(inside))


def apart(fits: Followed) -> np.ndarray:
    """Return the distances of the fitted centres from the true centres [pitches]."""
    return np.hypot(*fits.apart.T)


#: Each movement is combined with one shape, and each shape with one or two movements. With TACTILE_LONG, the tests use
#: all combinations.
PAIRS = [(shape, way) for i, way in enumerate(WAYS) for j, shape in enumerate(PUNCHES)
         if LONG or (i + j) % len(PUNCHES) == 0]


@cache
def both(shape: str, way: str) -> tuple[Followed, Followed]:
    return fits_of(shape, WAYS[way], None), fits_of(shape, WAYS[way], {})


@pytest.mark.slow
@pytest.mark.parametrize(('shape', 'way'), PAIRS)
def test_a_following_fit_is_as_accurate_as_a_search(shape, way):
    searched, followed = both(shape, way)
    assert np.median(apart(followed)) <= np.median(apart(searched)) + 0.03
    assert apart(followed).max() <= apart(searched).max() + 0.2


@pytest.mark.slow
@pytest.mark.parametrize(('shape', 'way'), PAIRS)
def test_a_following_fit_is_no_more_confident_than_it_is_accurate(shape, way):
    searched, followed = both(shape, way)
    assert followed.inside.mean() >= min(searched.inside.mean(), 0.95) - 1 / FRAMES


@pytest.mark.slow
@pytest.mark.parametrize('shape', [shape for shape, way in PAIRS if way == 'slides by 0.5 pitch a frame'])
def test_a_following_fit_does_not_lag_behind_a_slide(shape):
    """At 50 Hz and with taxels 2 mm apart, a slide by 0.5 pitch per frame is 50 mm/s."""
    searched, followed = both(shape, 'slides by 0.5 pitch a frame')
    assert abs((followed.apart - searched.apart)[:, 0].mean()) < 0.03


@pytest.fixture
def searches(monkeypatch) -> list[Shape]:
    """Return a list that records the shape of each search."""
    found: list[Shape] = []
    search = OutlineFit.search

    def counted(outline, evidence, layer=None):
        found.append(outline.shape)
        search(outline, evidence, layer)
    monkeypatch.setattr(OutlineFit, 'search', counted)
    return found


def test_a_contact_that_rests_is_searched_for_every_half_second(searches):
    fits_of('square', WAYS['rests'], {})
    assert len(searches) == 1 + int(FRAMES * PERIOD / SEARCH_PERIOD)


def test_a_contact_that_jumps_is_searched_for_at_once(searches):
    moments = [Moment(), Moment(), Moment(x=5.0), Moment(x=5.0)]
    followed = fits_of('square', moments, {})
    assert len(searches) == 2 and apart(followed).max() < 0.1


@pytest.mark.parametrize('kinds', [('punch', 'ball'), ('ball', 'punch')], ids='-'.join)
def test_a_punch_that_becomes_a_ball_with_the_same_outline_is_fitted_as_by_a_search(kinds):
    indenters = {'punch': flat_punch(Contact('circle', PUNCHES['circle'], 0.0, 0.0), 0.03, 0.12), 'ball': ball(0.1)}
    fields = [stress_field(solve(indenters[kind], (0.05, 0.03)), 60.0, DEPTH) for kind in kinds]
    outlines, rng = {}, np.random.default_rng(20261126)
    for number in range(20):  # The indenter changes after 10 frames, before the regular search after half a second.
        frame = measured(sample(fields[number // 10], MIDDLE, MIDDLE, 0.4, SIDE, SIDE), 0.4, rng, noise=0.01)
        contact = find_contact(frame, unit=None)
        searched, followed = (fit_shape(contact.values, contact.mask, Shape.CIRCLE, outlines=each,
                                        stamp=number * PERIOD)
                              for each in (None, outlines))
        deviation = np.sqrt(searched.covariance[2, 2])
        assert abs(followed.dimensions[0] - searched.dimensions[0]) < 0.5 * deviation
        assert np.sqrt(followed.covariance[2, 2]) > 0.8 * deviation


def test_stamps_that_go_back_begin_again(searches):
    outlines, values = {}, np.pad(np.ones((4, 4)), 3) * 1e4
    for stamp in (5.0, 5.02, 1.0):
        fit_shape(values, values > 0, Shape.SQUARE, outlines=outlines, stamp=stamp)
    assert len(searches) == 2


def test_another_contact_begins_again(searches):
    outlines, values = {}, np.pad(np.ones((4, 4)), 3) * 1e4
    for _ in range(2):
        fit_shape(values, values > 0, Shape.SQUARE, outlines=outlines)
        outlines.clear()
    assert len(searches) == 2


@pytest.mark.parametrize('shape', ['square', 'rectangle', 'right_triangle'])
def test_on_off_taxels_are_followed_as_near(shape):
    contact = Contact(shape, tuple(7 * each for each in PUNCHES[shape][:2]) + PUNCHES[shape][2:], MIDDLE, MIDDLE, 0.4)
    outlines, apart = {}, []
    for number in range(FRAMES):
        moved = replace(contact, x=MIDDLE + 0.1 * number, y=MIDDLE - 0.05 * number)
        pattern = moved.pattern(SIDE, SIDE)
        fits = [fit_shape(pattern, pattern, Shape(shape), outlines=each, stamp=number * PERIOD)
                for each in (None, outlines)]
        apart.append([np.hypot(fit.centre[0] - moved.x, fit.centre[1] - moved.y) for fit in fits])
    searched, followed = np.array(apart).T
    assert np.median(followed) <= np.median(searched) + 0.05 and followed.max() <= searched.max() + 0.2


def first_press(number: int, load: float, hidden: int) -> tuple[float, float]:
    """Return the radii [pitches] that following and searching find for a circle in its second frame.

    In the first frame, the circle has only ``load`` times the pressure, and the last ``hidden`` rows of the pad have no
    value.
    """
    rng, outlines = np.random.default_rng(number), {}
    contact = random_contact(rng, 'circle', 60.0, SIDE, SIDE)
    for stamp, share in ((0.0, load), (PERIOD, 1.0)):
        frame = pressure_frame(contact, rng, SIDE, SIDE, pressure=share, skin=Skin(noise=0.01, full_scale=1.0))
        if stamp == 0.0:
            frame[SIDE - hidden:] = np.nan
        pressed = find_contact(frame, unit=None)
        if not pressed.mask.any():
            continue
        followed, searched = (fit_shape(pressed.values, pressed.mask, Shape.CIRCLE, outlines=each, stamp=stamp)
                              for each in (outlines, None))
    return followed.dimensions[0], searched.dimensions[0]


@pytest.mark.parametrize('load, hidden', [(0.05, 0), (0.1, 0), (0.2, 0), (1.0, 13), (1.0, 15)])
def test_a_circle_first_seen_badly_is_fitted_as_by_a_search(load, hidden):
    """A circle that is touched lightly or is half hidden may look like a cone, whose fitted radius is larger."""
    pairs = np.array([first_press(number, load, hidden) for number in range(40 if LONG else 12)])
    assert abs(pairs[:, 0] - pairs[:, 1]).max() < 0.1
