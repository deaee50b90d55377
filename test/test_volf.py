"""Section 7: the planes, their fitting, and the classifier."""

import numpy as np
import pytest
import yaml
from patterns import ring

from tactile_node.errors import ConfigurationError
from tactile_node.helmholtz.features import compute_features
from tactile_node.package_files import config_path
from tactile_node.shape.recognition import Shape
from tactile_node.shape.volf import GROUPS, Plane, VolfClassifier, by_curves
from tactile_node.simulator.world import CLASSES, Purpose, generator, random_pattern
from training.curve_fitting import (
    READINGS,
    Samples,
    count_shares,
    draw_samples,
    fit_classifier,
    fit_curve,
    recognised,
)

ONE_PLANE = 'planes: {rectangle: {horizontal: %s, levels: [0, 1]}}'
AXES = ('value', 'N'), ('dif', 'alpha9')


@pytest.fixture(scope='module')
def classifier():
    return VolfClassifier.from_file(config_path('volf_curves.yaml'))


def recognise(classifier, mask):
    return classifier.recognise(compute_features(mask, GROUPS))


def test_a_known_curve_is_found_again():
    """Points on either side of v = 2 - 0.5 u, one in five on the wrong one: the best curve is the line."""
    rng = np.random.default_rng(1)
    u, v = rng.uniform(1, 4, 20_000), rng.uniform(-1, 3, 20_000)
    gain = np.where((v > 2 - 0.5 * u) == (rng.random(20_000) < 0.8), 1.0, -1.0)
    knots, levels = fit_curve(u, v, gain)
    plane = Plane(*AXES, tuple(knots), tuple(levels))
    at = np.linspace(1.1, 3.9, 15)
    np.testing.assert_allclose(np.log(plane.curve_at(np.exp(at) - 1) + 0.01), 2 - 0.5 * at, atol=0.12)


def test_no_straight_line_wins_more_than_the_fitted_curve():
    rng = np.random.default_rng(3)
    u, v = rng.uniform(1, 4, 3000), rng.normal(0, 1, 3000)
    gain = np.where(v + rng.normal(0, 0.7, 3000) > np.sin(u), 1.0, -1.0)
    won = gain[v > np.interp(u, *fit_curve(u, v, gain))].sum()
    lines = [gain[v > a + b * (u - 2.5)].sum() for a in np.linspace(-1, 1, 41) for b in np.linspace(-1, 1, 41)]
    assert won > max(lines)


def test_curve_continues_straight_beyond_its_ends():
    plane = Plane(*AXES, (1.0, 2.0, 4.0), (3.0, 2.0, 3.0))
    at = np.array([0.0, 0.5, 1.5, 3.0, 5.0])
    np.testing.assert_allclose(np.log(plane.curve_at(np.exp(at) - 1) + 0.01), [4, 3.5, 2.5, 2.5, 3.5])
    assert plane.height(np.exp(5.0) - 1, np.exp(3.75) - 0.01) == pytest.approx(0.25)


def test_shares_are_counted_by_answer_and_band():
    labels = np.array([0, 0, 1, 4])
    samples = Samples({('value', 'N'): np.array([15, 19, 19, 20])}, labels)
    shares = count_shares(np.array([0, 0, 0, 4]), samples)
    np.testing.assert_allclose(shares.sum(2), 1)
    assert shares[0, 0].tolist() == pytest.approx([3.1 / 4.5, 1.1 / 4.5, *[0.1 / 4.5] * 3])
    assert shares[1, 4, 4] == pytest.approx(2.1 / 2.5) and shares[7, 2, 2] == pytest.approx(1.1 / 1.5)


def test_curves_alone_take_the_first_that_is_exceeded():
    logits = np.array([[1, -1, -1, -1, -1], [1, 1, -1, -1, -1], [1, 1, 1, -1, -1], [1, 1, 1, 1, -1]])
    assert by_curves(logits).tolist() == [0, 1, 2, 3, 4]


def test_fitting_wins_where_the_planes_part_the_classes():
    """Five clusters that the tree can part: all are recognised; the first curve spares the second's class."""
    rng = np.random.default_rng(4)
    labels = np.arange(2000) % 5
    middle = {('value', 'N'): [50] * 5, ('dif', 'alpha9'): [8, 4, 1, 1, 1], ('min', 'P05'): [20] * 5,
              ('min', 'info_norm5'): [1, 1, 2, 1, 1], ('dif', 'P05'): [5] * 5,
              ('dif', 'info_norm5'): [1, 1, 1, 2, 1]}
    samples = Samples({name: np.array(values)[labels] * rng.uniform(0.9, 1.1, 2000)
                       for name, values in middle.items()}, labels)
    for third in READINGS.values():
        classifier = fit_classifier(samples, third)
        for right in recognised(classifier, samples).values():
            assert right.all()


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
    assert recognised(classifier, samples)['most_probable'].tolist() == singles


@pytest.mark.parametrize('content, message', [
    (None, 'No such file'), ('planes: [', 'expected'), ('{}', 'planes'),
    ('planes: {rectangle: 3}', 'written by'),
    ('just text', 'mapping'), (ONE_PLANE % '[a], vertical: [b, c], knots: [1, 2]', 'two names'),
    (ONE_PLANE % '[a, b], vertical: [b, c], knots: [1, 2, 3]', 'as many levels'),
    (ONE_PLANE % '[a, b], vertical: [b, c], knots: [.nan, 1]', 'finite'),
    (ONE_PLANE % '[a, b], vertical: [b, c], knots: [2, 1]', 'do not rise')])
def test_curves_that_are_none_are_refused(tmp_path, content, message):
    path = tmp_path / 'curves.yaml'
    if content is not None:
        path.write_text(content)
    with pytest.raises(ConfigurationError, match=message):
        VolfClassifier.from_file(path)


@pytest.mark.parametrize('change, message', [
    (lambda shares: shares.pop('circle'), 'circle'),
    (lambda shares: shares['circle'].pop(), 'written by'),
    (lambda shares: shares['circle'][0].__setitem__(0, -1.0), 'probabilities')])
def test_shares_that_are_none_are_refused(tmp_path, change, message):
    data = yaml.safe_load(config_path('volf_curves.yaml').read_text())
    change(data['shares'])
    path = tmp_path / 'curves.yaml'
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(ConfigurationError, match=message):
        VolfClassifier.from_file(path)
