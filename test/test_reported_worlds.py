"""What recognition is reported on: foreign and blemished figures, idle pads, cells of the search for blind spots."""

import numpy as np
import pytest
from scipy import ndimage

from bench.recognition import beside, blemish, foreign, nothing, several, spots
from bench.recognition.figures import Rate, p_value_behind
from bench.recognition.idle import IDLE
from bench.recognition.stamp import Stamp, pressed
from tactile_node.shape.recognition import Shape
from tactile_node.simulator.world import CLASSES, Contact, Purpose, generator, random_contact
from training.ground_truth.overlap import best_overlap


def random_stream(seed):
    return generator(Purpose.TEST, seed)


@pytest.mark.parametrize('family', foreign.FAMILIES)
def test_a_foreign_figure_is_of_one_piece_and_like_none_of_the_five(family):
    stamp, = foreign.bank(random_stream(1), family, 1)
    assert ndimage.label(stamp.filled)[1] == 1
    rng, filled = random_stream(2), np.pad(ndimage.binary_fill_holes(stamp.filled)[::2, ::2], 40)
    rows, cols = np.nonzero(filled)
    y, x = (np.indices(filled.shape) - np.array((rows.mean(), cols.mean()))[:, None, None]) / np.sqrt(len(rows))
    for k in range(150):  # shapes in random poses about its centre: none reaches the limit
        contact = random_contact(rng, CLASSES[k % 5], rng.uniform(0.8, 1.3), rows=1, cols=1)
        other = Contact(contact.shape, contact.dimensions, *rng.normal(0, 0.08, 2), angle=contact.angle)
        common = other.depth(x, y) >= 0
        assert (common & filled).sum() < 0.86 * (common | filled).sum()


@pytest.mark.parametrize('kind', blemish.BLEMISHES)
@pytest.mark.parametrize('shape', ['circle', 'right_triangle'])
def test_a_blemished_figure_is_still_most_like_its_shape(kind, shape):
    stamp, = blemish.bank(random_stream(3), kind, shape, 1)
    assert stamp.shape == shape
    assert 0.92 <= stamp.overlap < 0.995
    assert best_overlap(ndimage.binary_fill_holes(stamp.filled)).iou >= 0.915


def test_a_stamp_is_pressed_with_its_area_at_any_angle():
    stamp = Stamp('bar', np.ones((20, 60), bool), 'rectangle', 1.0)
    rng, angles = random_stream(4), []
    for _ in range(40):
        frame = pressed(stamp, rng, 120.0, on_off=True)
        assert frame.dtype == bool
        assert frame.sum() == pytest.approx(120, abs=15)
        rows, cols = np.nonzero(frame)
        covariance = np.cov(rows, cols)
        assert np.sqrt(np.prod(np.linalg.eigvalsh(covariance)[::-1] ** [1, -1])) == pytest.approx(3, rel=0.2)
        angles.append(np.degrees(np.arctan2(2 * covariance[0, 1], covariance[1, 1] - covariance[0, 0])))
    assert np.ptp(angles) > 270  # twice the angle, in a full turn
    values = pressed(stamp, rng, 120.0, on_off=False)
    assert values.dtype == float
    assert 0 < np.isnan(values).mean() < 0.1


def test_punches_on_one_pad_lie_beside_each_other_and_their_stresses_add():
    pad = beside.draw(random_stream(5), 3, area=50.0, gap=6.0)
    assert len(pad.labels) == len(pad.alone) == 3
    for under in pad.under:  # each covers about its area, and no other comes near
        assert 30 < under.sum() < 60
        others = pad.under.sum(0) > under
        assert ndimage.distance_transform_edt(~others)[under].min() > 5
    strongest = np.nanmax(pad.together)
    apart = np.abs(pad.together - pad.alone.sum(0))
    assert np.nanmedian(apart) < 0.03 and np.nanmax(apart) < 0.1 + 0.2 * strongest
    assert 0 < np.isnan(pad.together).mean() < 0.1


@pytest.mark.parametrize('kind', IDLE)
def test_idle_pads_are_sequences_of_frames(kind):
    rng = random_stream(5)
    for side in (8, 16, 32):
        idle = IDLE[kind](rng, 20, side)
        assert idle.frames.shape[1:] == (side, side)
        assert len(idle.frames) - idle.begin == 20
        assert idle.frames.dtype in (bool, float)
        assert np.isfinite(idle.frames.astype(float)).all()


def test_a_line_is_one_taxel_wide_and_ends_at_the_edges():
    rng = random_stream(6)
    for _ in range(60):
        frame = IDLE['line, edge to edge'](rng, 1, 16).frames[0]
        if frame.dtype != bool:
            continue
        assert 8 <= frame.sum() <= 16
        assert ndimage.label(frame, np.ones((3, 3)))[1] == 1
        inner = frame[1:-1, 1:-1]
        assert not (inner[:-1, :-1] & inner[1:, :-1] & inner[:-1, 1:] & inner[1:, 1:]).any()
        assert frame.sum() - inner.sum() >= 2


def test_leftover_is_a_part_of_the_contact_that_was_released():
    rng = random_stream(7)
    for _ in range(20):
        idle = IDLE['leftover after a release'](rng, 10, 32)
        if idle.frames.dtype == bool:
            held, left = idle.frames[0], idle.frames[idle.begin]
            assert idle.begin == 50
            assert not (left & ~held).any()
            assert 0.0 < left.sum() / held.sum() < 0.4


def test_tables_say_how_many_were_counted():
    seen = nothing.Seen('drift', Rate(1, 50), {Shape.CIRCLE: 1}, 0.1, Rate(0, 1))
    punches = several.Several(2, 25, 4.0, *3 * [Rate(9, 10)])
    assert nothing.table([seen]).rows[0][:2] == ['drift', '50'] and several.table([punches]).rows[0][3] == '10'


def test_cells_keep_what_they_say():
    rng = random_stream(8)
    for cell in spots.cells():
        contact, side = spots.contact_in(cell, cell.kinds(1)[0], rng)
        assert contact.reach + spots.MARGIN <= side / 2
        if cell.angle is not None:
            assert (np.degrees(contact.angle) - cell.angle) % 90 == pytest.approx(0, abs=1e-9) or \
                (np.degrees(contact.angle) - cell.angle) % 90 == pytest.approx(90, abs=1e-9)
        if cell.places:
            assert (contact.x % 1, contact.y % 1) in cell.places
        if cell.width is not None:
            longest = 2 * contact.dimensions[0] if contact.shape == 'circle' else max(contact.dimensions[:2])
            assert longest == pytest.approx(cell.width)
    assert {cell.angle for cell in spots.cells()} >= {0, 45, 90}
    assert len({(cell.curve, cell.label, cell.on_off) for cell in spots.cells()}) == len(spots.cells())


def test_the_p_value_behaves_as_one():
    """Exactly at the limit it is below p in a fraction p of experiments."""
    rng, below = random_stream(9), 0
    for _ in range(2000):
        kind = rng.choice(3, 2000, p=(0.02, 0.035, 0.945))  # won, lost, alike: 0.015 behind
        below += p_value_behind(kind != 1, kind != 0, 0.015) < 0.05
    assert below / 2000 == pytest.approx(0.05, abs=0.015)
    always = np.full(1000, True)
    assert p_value_behind(np.arange(1000) >= 40, always, 0.015) < 1e-3
    assert p_value_behind(always, np.arange(1000) >= 40, 0.015) > 0.999
    assert p_value_behind(always, always, 0.015) > 0.999
