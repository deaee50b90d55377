"""Tests for the features in sections 4 to 6 of the paper.

The expected values come from plain definitions, worked examples and invariances.
"""

import json
import math
import os

import by_definition
import numpy as np
import pytest
from patterns import L_OF_THREE, assorted, cropped, rotated_patterns

from tactile_node.errors import InputError
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.helmholtz.rotation import ANGLES


def assert_same(found, expected, name):
    if expected is None or math.isnan(expected):
        assert math.isnan(found), name
    else:
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-12), name


@pytest.mark.parametrize('name', assorted())
def test_every_feature_is_that_of_the_definition(name):
    found, expected = compute_features(assorted()[name]).values, by_definition.of_pattern(assorted()[name])
    assert list(found) == list(expected)
    for feature, value in expected.items():
        assert_same(found[feature], value, feature)


@pytest.mark.parametrize('name', assorted())
def test_every_rotated_pattern_is_that_of_the_definition(name):
    """The test uses every third angle from one that depends on the pattern, or every angle with TACTILE_LONG."""
    mask, begin = assorted()[name], list(assorted()).index(name) % 3
    chosen = slice(None) if os.environ.get('TACTILE_LONG') else slice(begin, None, 3)
    for angle, rotated in [*zip(ANGLES, rotated_patterns(mask))][chosen]:
        np.testing.assert_array_equal(cropped(rotated),
                                      cropped(by_definition.rotated(mask, int(angle))), f'{angle}°')


@pytest.mark.parametrize('name', ['one taxel', 'row', 'two apart', 'L', 'specks 3', 'blob 1', 'shape 3'])
def test_extremes_over_the_turns_are_those_of_the_definition(name):
    mask = assorted()[name]
    found = compute_features(mask).rotated
    for feature, extremes in by_definition.over_rotations(mask).items():
        for value, expected in zip(found[feature], extremes or (None, None, None)):
            assert_same(value, expected, feature)


def test_worked_example_of_three_taxels():
    values = compute_features(L_OF_THREE).values
    expected = {'lambda5': 4 - math.sqrt(2), 'info_sum5': 8, 'info_sq5': 22, 'info_norm5': 22 / 3, 'x5': 0.75,
                'y5': 0.25, 'V5': 0.790569, 'alpha5': 71.565051, 'P05': 3, 'lambda9': 2.303515,
                'alpha9': 74.054604}
    for name, value in expected.items():
        assert values[name] == pytest.approx(value, abs=5e-7), name


def test_undefined_is_null_in_json():
    line = json.loads(json.dumps(compute_features(np.ones((1, 1), bool)).as_json(), allow_nan=False))
    assert line['lambda5'] == 4 and line['alpha5'] is None
    assert line['rotated']['alpha5'] == dict.fromkeys(('min', 'max', 'dif', 'min_angle', 'max_angle'))


def test_large_patterns_have_all_features_but_eigenvalues():
    mask = np.ones((81, 100), bool)
    values = compute_features(mask, Group.ALL & ~Group.ROTATED).values
    assert {name for name, value in values.items() if math.isnan(value)} == {
        f'lambda{k}{suffix}' for k in (5, 9) for suffix in ('', '_border5', '_border9')}
    assert compute_features(mask[:80], Group.EIGENVALUES).values['lambda5'] == pytest.approx(
        4 - 2 * math.cos(math.pi / 81) - 2 * math.cos(math.pi / 101))


def test_groups_select():
    assert list(compute_features(L_OF_THREE, Group.NONE).values) == ['N', 'P05', 'P09']
    classifier = compute_features(L_OF_THREE, Group.CLASSIFIER)
    assert {'alpha9', 'info_norm5'} < set(classifier.rotated) and 'lambda5' not in classifier.values


@pytest.mark.parametrize('wrong', [np.ones((2, 2)), np.ones(4, bool), [[True]]])
def test_an_array_that_is_not_a_pattern_is_refused(wrong):
    with pytest.raises(InputError, match='bool array of shape'):
        compute_features(wrong)
