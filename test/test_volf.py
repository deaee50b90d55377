"""Section 7 of the paper: the planes, how they are fitted, and the classifier."""

import numpy as np
import pytest
import yaml

from tactile_node.errors import ConfigurationError
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.package_files import config_path
from tactile_node.shape.recognition import Shape
from tactile_node.shape.volf import Plane, VolfClassifier
from training.curve_fitting import (
    READINGS,
    Samples,
    count_shares,
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
    return classifier.classify(compute_features(mask, Group.CLASSIFIER))


def test_a_known_curve_is_found_again():
    """The points lie on both sides of the line v = 2 - 0.5 u, and one in five lies on the wrong side.

    The best separating curve is the line v = 2 - 0.5 u.
    """
    rng = np.random.default_rng(1)
    u, v = rng.uniform(1, 4, 20_000), rng.uniform(-1, 3, 20_000)
    gain = np.where((v > 2 - 0.5 * u) == (rng.random(20_000) < 0.8), 1.0, -1.0)
    knots, levels = fit_curve(u, v, gain)
    plane = Plane(*AXES, tuple(knots), tuple(levels))
    at = np.linspace(1.1, 3.9, 15)
    np.testing.assert_allclose(np.log(plane.curve_at(np.exp(at) - 1) + 0.01), 2 - 0.5 * at, atol=0.12)


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


def test_fitting_wins_where_the_planes_part_the_classes():
    """The tree of planes can separate the five clusters, so all of them must be recognised.

    The first curve does not cut through the classes of the second plane.
    """
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
    assert recognise(classifier, scattered).shape == Shape.UNKNOWN, 'no two of these taxels are neighbours'


@pytest.mark.parametrize('content, message', [
    (None, 'No such file'), ('planes: [', 'expected'), ('{}', 'planes'),
    ('planes: {rectangle: 3}', 'written by'),
    ('just text', 'mapping'), (ONE_PLANE % '[a], vertical: [b, c], knots: [1, 2]', 'two names'),
    (ONE_PLANE % '[a, b], vertical: [b, c], knots: [1, 2, 3]', 'as many levels'),
    (ONE_PLANE % '[a, b], vertical: [b, c], knots: [.nan, 1]', 'finite'),
    (ONE_PLANE % '[a, b], vertical: [b, c], knots: [2, 1]', 'do not rise')])
def test_impossible_curves_are_refused(tmp_path, content, message):
    path = tmp_path / 'curves.yaml'
    if content is not None:
        path.write_text(content)
    with pytest.raises(ConfigurationError, match=message):
        VolfClassifier.from_file(path)


@pytest.mark.parametrize('change, message', [
    (lambda shares: shares.pop('circle'), 'circle'),
    (lambda shares: shares['circle'].pop(), 'written by'),
    (lambda shares: shares['circle'][0].__setitem__(0, -1.0), 'probabilities')])
def test_impossible_shares_are_refused(tmp_path, change, message):
    data = yaml.safe_load(config_path('volf_curves.yaml').read_text())
    change(data['shares'])
    path = tmp_path / 'curves.yaml'
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(ConfigurationError, match=message):
        VolfClassifier.from_file(path)
