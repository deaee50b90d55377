"""Training data that is computed in bulk equals the library's results for the same frames.

The labels of the training data are derived from the overlaps with the shapes.
"""

import numpy as np
import pytest
from scipy import ndimage

from tactile_node.contact.pattern import PatternExtractor
from tactile_node.contact.press import PressThresholds
from tactile_node.errors import ConfigurationError
from tactile_node.shape.invariants import describe_all
from tactile_node.shape.patch import joined, make_patch
from tactile_node.simulator.world import random_contact
from training import drawn_by
from training.batch import draw_forms
from training.blemishes import BLEMISHES
from training.code_digest import code_digest
from training.drawn_by import claim
from training.families import FAMILIES
from training.forms import labels_of, make_forms
from training.ground_truth.seeds import Purpose, generator
from training.held_out import HELD_OUT
from training.hidden import draw_hidden
from training.noise import draw_noise
from training.patches import samples_of
from training.samples import LEVEL_STEPS, UNKNOWN

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
    numbers = describe_all(patch.level[None], patch.unseen[None], np.array([patch.scale]))
    np.testing.assert_allclose(found.geometry[:1], numbers, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(found.levels[0] / LEVEL_STEPS, patch.level.clip(0, 255 / LEVEL_STEPS), atol=0.01)
    np.testing.assert_allclose(found.unseen[0] / 255, patch.unseen, atol=0.01)


def test_labels_follow_from_overlaps():
    # The figure is foreign, because its overlap with every shape is too small.
    overlaps = np.array([[0.84, 0.80, 0.80, 0.5, 0.5],
                         # The overlap lies between those of foreign and of known figures.
                         [0.90, 0.80, 0.80, 0.5, 0.5],
                         [0.94, 0.80, 0.80, 0.5, 0.5],
                         [0.80, 0.95, 0.953, 0.5, 0.5],  # Every square is also a rectangle.
                         [0.60, 0.70, 0.95, 0.5, 0.5],
                         [0.60, 0.85, 0.95, 0.5, 0.5],  # The figure is a little longer than wide.
                         [0.60, 0.50, 0.50, 0.95, 0.94]])  # The triangle is both right and isosceles.
    assert labels_of(overlaps).tolist() == [UNKNOWN, -1, CIRCLE, SQUARE, RECTANGLE, -1, -1]


@pytest.mark.slow
@pytest.mark.parametrize('families', [FAMILIES, BLEMISHES, HELD_OUT])
def test_every_family_draws_figures_of_the_area_that_is_asked_for(families):
    forms = make_forms(generator(Purpose.TEST, 7), dict(list(families.items())[:6]), 6)
    area = forms.cell ** 2 * (forms.distance > 0).sum((1, 2))
    np.testing.assert_allclose(area, 1, atol=0.05)
    found = draw_forms(generator(Purpose.TEST, 8), forms, np.full(6, 150.0), on_off=True, faulty=0.0, pad=80)
    np.testing.assert_allclose(np.exp(found.geometry[:, 0]), 150, rtol=0.15)


@pytest.mark.parametrize('on_off', [True, False])
def test_noise_has_no_label_but_unknown(on_off):
    found = draw_noise(generator(Purpose.TEST, 12), 60, on_off)
    assert len(found.labels) > 20 and (found.labels == UNKNOWN).all()


@pytest.mark.parametrize('on_off', [True, False])
def test_contacts_that_are_seen_in_part_keep_the_label_of_the_whole(on_off):
    samples = draw_hidden(np.random.default_rng(6), 60, on_off)
    assert len(samples.labels) == 60 and set(samples.labels) == set(range(UNKNOWN + 1))
    near = samples.levels > 80
    beside = np.array([ndimage.binary_dilation(contact, iterations=2) for contact in near])
    hidden_beside = (samples.unseen > 128) & beside
    assert 0.3 < (hidden_beside.sum((1, 2)) > 3).mean() < 1, 'most must miss taxels in or near the contact, not all'


def test_samples_of_another_code_are_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(drawn_by, 'DRAWING', ['training/ground_truth'])  # Reading all of the code takes longer.
    claim(tmp_path / 'samples')
    (tmp_path / 'samples' / 'on_off_bulk_0.npz').touch()
    claim(tmp_path / 'samples')  # The current version of the code drew the samples.
    (tmp_path / 'samples' / 'drawn_by').write_text('another')
    with pytest.raises(ConfigurationError):
        claim(tmp_path / 'samples')
    (tmp_path / 'samples' / 'drawn_by').unlink()
    with pytest.raises(ConfigurationError, match='unknown'):
        claim(tmp_path / 'samples')


@pytest.mark.parametrize(('source', 'is_same'), [
    ('def f():\n    return 1  # one\n', True),
    ('"""Text."""\n\n\ndef f():\n    """Return one."""\n    return 1\n', True),
    ('def f():\n    return 2\n', False),
    ('def g():\n    return 1\n', False)])
def test_only_code_changes_the_digest(source, is_same, tmp_path):
    paths = [tmp_path / 'before.py', tmp_path / 'after.py']
    paths[0].write_text('def f():\n    return 1\n')
    paths[1].write_text(source)
    before, after = (code_digest([path]) for path in paths)
    assert (before == after) == is_same
