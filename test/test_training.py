"""Training data drawn in bulk is what the library would make of the same frames, and is labelled by overlap."""

import numpy as np
import pytest
from scipy import ndimage

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.errors import ConfigurationError
from tactile_node.shape.invariants import describe
from tactile_node.shape.patch import joined, make_patch
from tactile_node.shape.recogniser import SIZES
from tactile_node.simulator.world import Contact, Purpose, generator, random_contact
from training.batch import aligned, draw_forms, draw_many
from training.blemishes import BLEMISHES
from training.drawn_by import claim
from training.families import FAMILIES
from training.forms import labels_of, make_forms
from training.held_out import HELD_OUT
from training.hidden import LINES, draw_hidden, hidden_taxels
from training.noise import draw_noise
from training.patches import samples_of
from training.samples import LEVEL_STEPS, UNKNOWN
from training.segmentation import own_level

CIRCLE, SQUARE, RECTANGLE, RIGHT, ISOSCELES = range(UNKNOWN)


@pytest.mark.parametrize('kind, area', [('rectangle', 40), ('isosceles_triangle', 80), ('right_triangle', 900)])
@pytest.mark.parametrize('graded', [True, False])
def test_samples_in_bulk_are_those_of_the_library(kind, area, graded):
    rng = generator(Purpose.TEST, area)
    frame = random_contact(rng, kind, area, rows=90, cols=90).pattern(90, 90).astype(float)
    if graded:
        frame += rng.uniform(0, 0.2, frame.shape)
    dead = np.zeros(frame.shape, bool)
    found = samples_of(rng, frame[None], np.full((1, 1, 1), 0.5), dead[None], np.array([2]), graded)
    pattern = PatternExtractor(PressThresholds(0.5, 0.4)).extract(frame)
    patch = make_patch(pattern.values, joined(pattern))
    np.testing.assert_allclose(found.geometry[0], describe(patch), rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(found.levels[0] / LEVEL_STEPS, patch.level.clip(0, 255 / LEVEL_STEPS), atol=0.01)
    np.testing.assert_allclose(found.unseen[0] / 255, patch.unseen, atol=0.01)


def test_labels_follow_from_overlaps():
    overlaps = np.array([[0.84, 0.80, 0.80, 0.5, 0.5],    # foreign to all
                         [0.90, 0.80, 0.80, 0.5, 0.5],    # between
                         [0.94, 0.80, 0.80, 0.5, 0.5],
                         [0.80, 0.95, 0.953, 0.5, 0.5],   # every square is a rectangle
                         [0.60, 0.70, 0.95, 0.5, 0.5],
                         [0.60, 0.85, 0.95, 0.5, 0.5],    # a little longer than wide
                         [0.60, 0.50, 0.50, 0.95, 0.94]])  # right and isosceles
    assert labels_of(overlaps).tolist() == [UNKNOWN, -1, CIRCLE, SQUARE, RECTANGLE, -1, -1]


@pytest.mark.parametrize('families', [FAMILIES, BLEMISHES, HELD_OUT])
def test_every_family_draws_figures_of_the_area_that_is_asked_for(families):
    forms = make_forms(generator(Purpose.TEST, 7), dict(list(families.items())[:6]), 6)
    area = forms.cell ** 2 * (forms.distance > 0).sum((1, 2))
    np.testing.assert_allclose(area, 1, atol=0.05)
    found = draw_forms(generator(Purpose.TEST, 8), forms, np.full(6, 150.0), on_off=True, faulty=0.0, pad=80)
    np.testing.assert_allclose(np.exp(found.geometry[:, 0]), 150, rtol=0.15)


def test_blemishes_are_known_or_foreign_by_their_size():
    forms = make_forms(generator(Purpose.TEST, 9), BLEMISHES, 28)
    best = forms.overlaps.max(1)
    assert (forms.labels[best < 0.85] == UNKNOWN).all() and (forms.labels[best >= 0.85] != UNKNOWN).all()
    assert (forms.labels[best < 0.92] < 0).sum() + (forms.labels == UNKNOWN).sum() == (best < 0.92).sum()
    assert ((forms.labels >= 0) & (forms.labels < UNKNOWN)).any()


def test_aligned_contacts_lie_exactly_along_the_lattice():
    rng = generator(Purpose.TEST, 10)
    found = [aligned(rng, random_contact(rng, 'square', 60)) for _ in range(60)]
    turns = np.array([contact.angle for contact in found]) / (np.pi / 4)
    np.testing.assert_allclose(turns, turns.round(), atol=1e-9)
    on_borders = [contact for contact in found if contact.dimensions[0] == 8
                  and round(contact.angle / np.pi * 4) % 2 == 0 and contact.x % 1 == contact.y % 1 == 0.5]
    assert on_borders
    assert all(contact.pattern().sum() == 64 for contact in on_borders)


def test_contacts_wider_than_a_patch_are_drawn_too():
    found = draw_many(generator(Purpose.TEST, 11), 40, True, (2000, 4000), pad=76)
    assert np.exp(found.geometry[:, 0]).max() > 2500 and set(found.labels) > {CIRCLE, SQUARE}


@pytest.mark.parametrize('on_off', [True, False])
def test_noise_has_no_label_but_unknown(on_off):
    found = draw_noise(generator(Purpose.TEST, 12), 60, on_off)
    assert len(found.labels) > 20 and (found.labels == UNKNOWN).all()


def test_own_level_is_what_most_of_the_contact_reads():
    frame = 0.07 * Contact('circle', (5.0,), x=12, y=12).pattern(25, 25)
    frame[3, 3] = np.nan
    assert own_level(frame) == pytest.approx(0.07)


def test_sizes_of_the_calibration_rise():
    assert (np.diff(SIZES) > 0).all()


def test_hidden_taxels_are_whole_tpdos_or_adjacent_lines():
    rng, shares = np.random.default_rng(5), []
    for _ in range(300):
        hidden = hidden_taxels(rng, 16, 16)
        shares.append(hidden.mean())
        lines = [axis for axis in (0, 1) if (hidden.all(axis) == hidden.any(axis)).all()]
        if lines and 0 < hidden.all(lines[0]).sum() <= LINES:
            continue
        along_rows, along_cols = ((turned.reshape(16, 8, 2).any(2) == turned.reshape(16, 8, 2).all(2)).all()
                                  for turned in (hidden, hidden.T))
        assert along_rows or along_cols, 'neither pairs along rows nor along columns are hidden together'
    assert 0 < min(shares) < 0.02 and 0.4 < max(shares) <= 0.5 and 0.1 < np.mean(shares) < 0.25


@pytest.mark.parametrize('on_off', [True, False])
def test_contacts_that_are_seen_in_part_keep_the_label_of_the_whole(on_off):
    samples = draw_hidden(np.random.default_rng(6), 60, on_off)
    assert len(samples.labels) == 60 and set(samples.labels) == set(range(UNKNOWN + 1))
    near = samples.levels > 80
    beside = np.array([ndimage.binary_dilation(contact, iterations=2) for contact in near])
    hidden_beside = (samples.unseen > 128) & beside
    assert 0.3 < (hidden_beside.sum((1, 2)) > 3).mean() < 1, 'most, not all, miss taxels in the contact or next to it'


def test_samples_of_another_code_are_not_read(tmp_path):
    claim(tmp_path / 'samples')
    (tmp_path / 'samples' / 'on_off_bulk_0.npz').touch()
    claim(tmp_path / 'samples')  # of this code
    (tmp_path / 'samples' / 'drawn_by').write_text('another')
    with pytest.raises(ConfigurationError):
        claim(tmp_path / 'samples')
    (tmp_path / 'samples' / 'drawn_by').unlink()
    with pytest.raises(ConfigurationError, match='unknown'):
        claim(tmp_path / 'samples')
