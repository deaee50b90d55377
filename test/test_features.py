"""Sections 4 to 6: every feature against the plain definition, worked examples, invariances."""

import json
import math

import by_definition
import numpy as np
import pytest
from patterns import L_OF_THREE, assorted, cropped, ring, rotated_patterns, shapes, specks

from tactile_node.errors import InputError
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.helmholtz.rotation import ANGLES, fill_holes, fine_lattice


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
    mask = assorted()[name]
    for angle, rotated in zip(ANGLES, rotated_patterns(mask)):
        np.testing.assert_array_equal(cropped(rotated),
                                      cropped(by_definition.rotated(mask, int(angle))), f'{angle}°')


@pytest.mark.parametrize('name', ['one taxel', 'row', 'two apart', 'L', 'specks 3', 'blob 1', 'shape 3'])
def test_extremes_over_the_turns_are_those_of_the_definition(name):
    mask = assorted()[name]
    found = compute_features(mask).rotated
    for feature, extremes in by_definition.over_rotations(mask).items():
        for value, expected in zip(found[feature], extremes or (None, None, None)):
            assert_same(value, expected, feature)


def test_angle_of_an_extreme_is_where_it_occurs():
    mask = shapes(40)[2]
    found = compute_features(mask, Group.NONE | Group.ROTATED).rotated['N']
    for angle, value in ((found.min_angle, found.min), (found.max_angle, found.max)):
        assert len(by_definition.taxels(by_definition.rotated(mask, angle))) == value


def test_worked_example_of_three_taxels():
    values = compute_features(L_OF_THREE).values
    expected = {'lambda5': 4 - math.sqrt(2), 'info_sum5': 8, 'info_sq5': 22, 'info_norm5': 22 / 3, 'x5': 0.75,
                'y5': 0.25, 'V5': 0.790569, 'alpha5': 71.565051, 'P05': 3, 'lambda9': 2.303515,
                'alpha9': 74.054604}
    for name, value in expected.items():
        assert values[name] == pytest.approx(value, abs=5e-7), name


def test_worked_example_of_a_full_square():
    values = compute_features(np.ones((3, 3), bool)).values
    expected = {'lambda5': 1.171573, 'info_sum5': 12, 'info_sq5': 20, 'P05': 8, 'alpha5': 59.036243,
                'lambda9': 1.114382, 'alpha9': 59.995079, 'lambda5_border5': 2, 'lambda9_border5': 1.822957}
    for name, value in expected.items():
        assert values[name] == pytest.approx(value, abs=5e-7), name


@pytest.mark.parametrize('rows, cols', [(2, 2), (4, 7), (9, 3)])
def test_known_sums_of_a_rectangle(rows, cols):
    """Row sums by five points: 2 at the four corners, 1 along the sides; by nine: 11/6 and 1."""
    values = compute_features(np.ones((rows, cols), bool), Group.INFORMATION).values
    along = 2 * (rows + cols) - 8
    assert values['info_sum5'] == 8 + along and values['info_sq5'] == 16 + along
    assert values['info_sum9'] == pytest.approx(4 * 11 / 6 + along)
    assert values['info_sq9'] == pytest.approx(4 * (11 / 6) ** 2 + along)


def test_fine_lattice_counts():
    assert fine_lattice(L_OF_THREE).sum() == 21
    assert fine_lattice(np.ones((2, 2), bool)).sum() == 36
    assert fine_lattice(np.ones((1, 5), bool)).sum() == 5, 'a line has no triangle'


@pytest.mark.parametrize('before, after', [
    (['#', '.', '#'], ['#', '#', '#']),
    (['#.#'], ['###']),
    (['#..', '...', '..#'], ['#..', '.#.', '..#']),
    (['..#', '...', '#..'], ['..#', '.#.', '#..']),
    (['#..#'], ['#..#']),
    # Rule 1 makes the sensor in the middle that rule 2 then needs on the left.
    (['#..', '..#', '#..'], ['#..', '###', '#..'])])
def test_hole_rules(before, after):
    mask, filled = (np.array([[c == '#' for c in row] for row in rows]) for rows in (before, after))
    np.testing.assert_array_equal(filled_holes(mask), filled)


def test_each_rule_fills_at_once():
    """A rule does not read what it fills itself: # . # . # fills two, # . . # none, along either axis."""
    mask = np.array([[c == '#' for c in '#.#.#..#']])
    expected = np.array([[c == '#' for c in '#####..#']])
    np.testing.assert_array_equal(filled_holes(mask), expected)
    np.testing.assert_array_equal(filled_holes(mask.T), expected.T)


def filled_holes(mask):
    """The rules applied to a pattern between two others, all of them the same; nothing crosses over."""
    stack = np.pad(np.array([mask] * 3), ((0, 0), (1, 1), (1, 1)))
    fill_holes(stack)
    assert (stack == stack[1]).all() and stack.sum() == stack[:, 1:-1, 1:-1].sum()
    return stack[1, 1:-1, 1:-1]


@pytest.mark.parametrize('seed', range(5))
def test_translation_changes_no_bit(seed):
    mask = specks(seed)
    moved = np.pad(mask, ((seed + 3, 2), (7 * seed, 5)))
    assert compute_features(mask).as_json() == compute_features(moved).as_json()


@pytest.mark.parametrize('name', ['ring', 'blob 2', 'shape 2', 'specks 4'])
def test_quarter_turns_keep_what_does_not_depend_on_numbering(name):
    mask = assorted()[name]
    first = compute_features(mask, Group.ALL & ~Group.ROTATED).values
    for quarter in (1, 2, 3):
        rotated = compute_features(np.rot90(mask, quarter), Group.ALL & ~Group.ROTATED).values
        for feature in first:
            if feature[0] in 'NPli':  # counts, lambda, info
                assert_same(rotated[feature], first[feature], feature)


def test_half_turn_mirrors_the_centre_of_gravity():
    """Numbers run backwards: i becomes N + 1 - j, so x and y become 1 - y and 1 - x."""
    for mask in [ring(), *shapes(40)]:
        first = compute_features(mask, Group.GRAVITY).values
        rotated = compute_features(mask[::-1, ::-1], Group.GRAVITY).values
        for k in (5, 9):
            assert rotated[f'x{k}'] == pytest.approx(1 - first[f'y{k}'])


def test_undefined_is_null_in_json():
    line = json.loads(json.dumps(compute_features(np.ones((1, 1), bool)).as_json(), allow_nan=False))
    assert line['lambda5'] == 4 and line['alpha5'] is None
    assert line['rotated']['alpha5'] == dict.fromkeys(('min', 'max', 'dif', 'min_angle', 'max_angle'))


def test_empty_pattern():
    line = compute_features(np.zeros((4, 5), bool)).as_json()
    assert [line[name] for name in ('N', 'P05', 'info_sum5', 'lambda5', 'info_norm5')] == [0, 0, 0, None, None]


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
def test_what_is_no_pattern_is_refused(wrong):
    with pytest.raises(InputError, match='bool array of shape'):
        compute_features(wrong)
