"""The data for the reported tests: foreign and damaged figures, skins with a halo, and the tables."""

import numpy as np
import pytest
from scipy import ndimage

from bench.recognition import blemish, foreign, halo_skins, nothing, several
from bench.recognition.figures import PercentRate
from tactile_node.contact.neighbours import grown
from tactile_node.shape.recognition import Shape
from tactile_node.simulator.figures import coverage
from tactile_node.simulator.world import CLASSES, Contact, random_contact
from training.ground_truth.overlap import best_overlap
from training.ground_truth.seeds import Purpose, generator


def random_stream(seed):
    return generator(Purpose.TEST, seed)


@pytest.mark.parametrize('family', foreign.FAMILIES)
def test_a_foreign_figure_is_of_one_piece_and_like_none_of_the_five(family):
    stamp, = foreign.bank(random_stream(1), family, foreign.FAMILIES[family], 1)
    assert ndimage.label(stamp.filled)[1] == 1
    rng, filled = random_stream(2), np.pad(ndimage.binary_fill_holes(stamp.filled)[::2, ::2], 40)
    rows, cols = np.nonzero(filled)
    y, x = (np.indices(filled.shape) - np.array((rows.mean(), cols.mean()))[:, None, None]) / np.sqrt(len(rows))
    # Shapes in random poses about the centre of the figure must all overlap the figure by less than the limit.
    for k in range(150):
        contact = random_contact(rng, CLASSES[k % 5], rng.uniform(0.8, 1.3), rows=1, cols=1)
        other = Contact(contact.shape, contact.dimensions, *rng.normal(0, 0.08, 2), angle=contact.angle)
        common = other.depth(x, y) >= 0
        assert (common & filled).sum() < 0.86 * (common | filled).sum()


@pytest.mark.parametrize('kind', blemish.BLEMISHES)
@pytest.mark.parametrize('shape', ['circle', 'right_triangle'])
def test_a_blemished_figure_is_still_most_like_its_shape(kind, shape):
    stamp, = blemish.bank(random_stream(3), kind, blemish.reported(kind, shape), shape, 1)
    assert stamp.shape == shape
    assert 0.92 <= stamp.overlap < 0.995
    assert best_overlap(ndimage.binary_fill_holes(stamp.filled)).iou >= 0.915


@pytest.mark.parametrize('beside', halo_skins.BESIDE[1:])
def test_the_taxels_next_to_a_contact_read_the_stated_share(beside, monkeypatch):
    shares, covered = [], []
    monkeypatch.setattr(halo_skins, 'coverage', lambda *args: covered.append(coverage(*args)) or covered[-1])
    for seed in range(30):
        skin = halo_skins.HaloSkin(random_stream(seed), beside)
        skin.gains[:] = 1.0
        skin.rest[:] = 0.0
        frame = skin.pressed('square')
        inside = covered[-1] >= 0.5
        around = grown(inside) & (covered[-1] == 0)
        shares.append(np.median(frame[around]) / np.median(frame[inside]))
    # The blur of a contact reaches the taxels next to it, too.
    assert np.median(shares) == pytest.approx(beside, abs=0.03)


def test_tables_say_how_many_were_counted():
    seen = nothing.DisturbanceResult('drift', PercentRate(1, 50), {Shape.CIRCLE: 1}, 0.1, PercentRate(0, 1))
    punches = several.Several(2, 25, 4.0, *3 * [PercentRate(9, 10)])
    assert nothing.table([seen]).rows[0][:2] == ['drift', '50'] and several.table([punches]).rows[0][3] == '10'
