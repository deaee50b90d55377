"""Section 7: the planes, their fitting, and the classifier."""

import numpy as np
import pytest
from patterns import ring

from tactile_node.config import config_path
from tactile_node.errors import ConfigurationError
from tactile_node.helmholtz.features import compute_features
from tactile_node.shape.fitting import draw_samples, recognised
from tactile_node.shape.plane import fit_plane
from tactile_node.shape.recognition import Shape
from tactile_node.shape.volf import GROUPS, VolfClassifier, by_curves, down_the_tree
from tactile_node.synthetic.seeds import Purpose, generator
from tactile_node.synthetic.world import CLASSES, random_pattern

ONE_PLANE = 'planes: {rectangle: {horizontal: %s, steepness: [1, 1], fitted: [0, 1]}}'
AXES = ('value', 'N'), ('dif', 'alpha9')


@pytest.fixture(scope='module')
def classifier():
    return VolfClassifier.from_file(config_path('volf_curves.yaml'))


def recognise(classifier, mask):
    return classifier.recognise(compute_features(mask, GROUPS))


def test_a_known_curve_is_found_again():
    """Points scattered about v = 2 - 0.5 u with logistic noise: maximum likelihood returns line and slope."""
    rng = np.random.default_rng(1)
    u = rng.uniform(1, 4, 20_000)
    v = rng.uniform(-1, 3, 20_000)
    is_above = rng.random(20_000) < 1 / (1 + np.exp(-5 * (v - (2 - 0.5 * u))))
    plane = fit_plane(*AXES, np.exp(u) - 1, np.exp(v) - 0.01, is_above)
    at = np.array([1.5, 2.5, 3.5])
    np.testing.assert_allclose(plane.curve_at(np.exp(at) - 1), np.exp(2 - 0.5 * at) - 0.01, rtol=0.06)
    assert plane.above(np.exp(2) - 1, np.exp(1.0) - 0.01) == pytest.approx(0.5, abs=0.06)
    assert plane.above(np.exp(2) - 1, np.exp(1.4) - 0.01) == pytest.approx(1 / (1 + np.exp(-2)), abs=0.06)


def test_curve_goes_on_straight_beyond_the_fitted_range():
    rng = np.random.default_rng(2)
    u, v = rng.uniform(1, 4, (2, 2000))
    plane = fit_plane(*AXES, np.exp(u) - 1, np.exp(v) - 0.01, v > 1 + 0.1 * u * u)
    outside = np.log(0.01 + plane.curve_at(np.exp(np.array([4.5, 5.0, 5.5])) - 1))
    assert np.diff(outside, 2) == pytest.approx(0, abs=1e-9)


def test_probabilities_go_down_the_tree():
    logits = np.log(np.array([1 / 4, 1.0, 2.0, 3.0]))  # above with 1/5, 1/2, 2/3, 3/4
    expected = [1 / 5, 4 / 5 / 2, 2 / 5 * 2 / 3, 2 / 15 * 3 / 4, 2 / 15 / 4]
    np.testing.assert_allclose(down_the_tree(logits), expected)
    np.testing.assert_allclose(down_the_tree(np.array([-1e4, -1e4, 1e4, 0.0])), [0, 0, 1, 0, 0])


def test_curves_alone_take_the_first_that_is_exceeded():
    logits = np.array([[1, -1, -1, -1, -1], [1, 1, -1, -1, -1], [1, 1, 1, -1, -1], [1, 1, 1, 1, -1]])
    assert by_curves(logits).tolist() == [0, 1, 2, 3, 4]


def test_nothing_is_none_and_little_is_unknown(classifier):
    assert recognise(classifier, np.zeros((9, 9), bool)).shape == Shape.NONE
    assert recognise(classifier, np.ones((2, 7), bool)).shape == Shape.UNKNOWN
    assert recognise(classifier, np.ones((3, 5), bool)).shape not in (Shape.NONE, Shape.UNKNOWN)
    scattered = np.zeros((40, 40), bool)
    scattered[::10, ::10] = True
    assert recognise(classifier, scattered).shape == Shape.UNKNOWN, 'no two taxels are neighbours'


@pytest.mark.parametrize('mask', [np.ones((5, 20), bool), ring(), np.ones((60, 60), bool),
                                  np.ones((1, 30), bool)])
def test_probabilities_of_all_seven_sum_to_one(classifier, mask):
    recognition = recognise(classifier, mask)
    assert set(recognition.probabilities) == set(Shape)
    assert sum(recognition.probabilities.values()) == pytest.approx(1)
    assert recognition.confidence == max(recognition.probabilities.values())
    assert recognition.as_json()['probabilities'][recognition.shape.value] == recognition.confidence


def test_recognition_is_far_above_chance(classifier):
    """Five classes: chance is 20 %. A bound against breakage, not the figure we claim."""
    rng = generator(Purpose.TEST, 7)
    right = [recognise(classifier, random_pattern(rng, shape, 75)).shape.value == shape
             for _ in range(40) for shape in CLASSES]
    assert np.mean(right) > 0.55


def test_vectorised_figures_agree_with_single_recognitions(classifier):
    samples = draw_samples(generator(Purpose.TEST, 8), 25)
    rng = generator(Purpose.TEST, 8)
    singles = []
    while len(singles) < 25:
        shape = CLASSES[len(singles) % 5]
        mask = random_pattern(rng, shape, float(np.exp(rng.uniform(*np.log((13.0, 300.0))))))
        if mask.sum() >= 15:
            singles.append(recognise(classifier, mask).shape.value == shape)
    assert recognised(classifier.planes, samples)['most_probable'].tolist() == singles


@pytest.mark.parametrize('content, message', [
    (None, 'No such file'), ('planes: [', 'expected'), ('{}', 'planes'),
    ('planes: {rectangle: 3}', 'written by'),
    ('just text', 'written by'), (ONE_PLANE % '[a], vertical: [b, c], curve: [1]', 'two names'),
    (ONE_PLANE % '[a, b], vertical: [b, c], curve: [.nan]', 'finite')])
def test_curves_that_are_none_are_refused(tmp_path, content, message):
    path = tmp_path / 'curves.yaml'
    if content is not None:
        path.write_text(content)
    with pytest.raises(ConfigurationError, match=message):
        VolfClassifier.from_file(path)
