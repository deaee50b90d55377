"""`make reproduce`: its statistics by hand, its worlds, and a whole small run."""

import csv
import re

import by_definition
import numpy as np
import pytest

from bench.reproduce import main
from bench.reproduction.inside import ACTIVE, areas_around, by_inside, replaced, wanted_inside
from bench.reproduction.methods import SIZES, NearestNeighbours, confusion, lost_in_plane
from bench.reproduction.sampling import INSIDE, Wanted, count_inside, draw, plane_features
from bench.reproduction.worlds import EQUILATERAL_TRIANGLES, WORLDS, draw_contact, draw_pattern
from tactile_node.helmholtz.features import compute_features
from tactile_node.rate import Rate
from tactile_node.shape.recognition import Shape
from tactile_node.shape.volf import ANSWERS, GROUPS, plane_feature
from tactile_node.simulator.world import CLASSES, Purpose, generator, random_pattern
from training.curve_fitting import COLUMNS, Samples


def test_wilson_interval_of_a_textbook_case():
    """8 of 10: 0.4902 to 0.9433 (A. Agresti, B. Coull 1998); all right is not certainty."""
    found = Rate.of(np.arange(10) < 8)
    assert (found.value, found.total) == (0.8, 10)
    assert (found.low, found.high) == pytest.approx((0.4902, 0.9433), abs=5e-5)
    assert Rate.of(np.ones(100, bool)).low == pytest.approx(100 / (100 + 1.96 ** 2), abs=1e-4)


def test_the_first_wrong_decision_bears_the_loss():
    """Order: rectangle, right triangle (plane 1), isosceles triangle (2), square, circle (3)."""
    labels = np.array([0, 1, 2, 2, 3, 4, 4, 4])
    answer = np.array([1, 1, 0, 4, 4, 2, 3, 4])
    assert lost_in_plane(answer, labels) == {1: 2 / 8, 2: 2 / 8, 3: 2 / 8}
    assert confusion(answer, labels)[4].tolist() == pytest.approx([0, 0, 1 / 3, 1 / 3, 1 / 3])


def test_features_over_all_angles_are_those_of_the_classifier():
    mask = random_pattern(generator(Purpose.TEST, 20), 'square', 60)
    features = compute_features(mask, GROUPS)
    assert plane_features(mask)[:6] == [plane_feature(features, column) for column in COLUMNS]


def test_without_vanishing_angles_extremes_only_shrink():
    rng = generator(Purpose.TEST, 21)
    smaller = 0
    for shape in CLASSES * 4:
        every, kept = np.split(np.array(plane_features(random_pattern(rng, shape, 20))), 2)
        for column, all_angles, some in zip(COLUMNS, every, kept):
            assert some == all_angles if column[0] == 'value' else (
                some >= all_angles if column[0] == 'min' else some <= all_angles)
            smaller += some != all_angles
    assert smaller, 'patterns of 20 taxels have vanishing angles'


@pytest.mark.parametrize('world', WORLDS)
def test_patterns_of_a_world_have_the_required_area(world):
    rng = generator(Purpose.TEST, 22)
    for shape in CLASSES:
        taxels = [draw_pattern(world, rng, shape, 60).sum() for _ in range(60)]
        assert np.mean(taxels) == pytest.approx(60, abs=4 * np.std(taxels) / np.sqrt(60) + 1e-9)


@pytest.mark.parametrize('shape', CLASSES)
def test_inside_taxels_are_those_with_four_active_neighbours(shape):
    rng = generator(Purpose.TEST, 23)
    for area in (3, 15, 60):
        mask = random_pattern(rng, shape, area)
        assert count_inside(mask) == by_definition.inside(mask)
    assert count_inside(np.ones((5, 7), bool)) == 15, 'a full rectangle: (5 - 2) x (7 - 2)'


def test_equilateral_triangles_have_equal_sides_and_no_other_class_is_changed():
    corners = draw_contact(EQUILATERAL_TRIANGLES, generator(Purpose.TEST, 24), 'isosceles_triangle', 60, 40).outline()
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    assert sides == pytest.approx([np.sqrt(4 * 60 / np.sqrt(3))] * 3)
    for shape in CLASSES:
        one, other = (draw_pattern(world, generator(Purpose.TEST, 25), shape, 60)
                      for world in ('benchmark', 'equilateral triangles'))
        same = one.shape == other.shape and (one == other).all()
        assert same == (shape != 'isosceles_triangle')


@pytest.mark.parametrize('size', [SIZES[0], SIZES[-1]])
def test_no_class_has_so_many_inside_taxels_beyond_the_areas_searched(size):
    rng = generator(Purpose.TEST, 26)
    for area, beyond in zip(areas_around(size), (np.less, np.greater)):
        for shape in CLASSES:
            assert all(beyond(count_inside(random_pattern(rng, shape, area)), size) for _ in range(60)), (area, shape)


def test_patterns_drawn_by_inside_taxels_have_that_many_in_every_class():
    wanted = {'a': Wanted('benchmark', Purpose.TEST, 20, areas_around(20), inside=20)}
    drawn = draw(wanted, 3, 1)['a']
    for samples in drawn:
        assert (samples.of(INSIDE) == 20).all() and (samples.of(ACTIVE) > 20).all()
        assert np.bincount(samples.labels).tolist() == [4] * 5
        assert (by_inside(samples).of(ACTIVE) == 20).all()


def test_only_the_isosceles_triangles_are_replaced_one_for_one():
    triangle = Shape.ISOSCELES_TRIANGLE
    many = len([label for label in range(18) if ANSWERS[label % 5] is triangle])
    wanted = {'all': Wanted('benchmark', Purpose.TEST, 18, (30, 30)),
              'new': Wanted('equilateral triangles', Purpose.TEST, many, (30, 30), (triangle,))}
    drawn = draw(wanted, 4, 1)
    found, number = replaced(drawn['all'], drawn['new']), ANSWERS.index(triangle)
    for old, new, joined in zip(drawn['all'], drawn['new'], found):
        np.testing.assert_array_equal(np.bincount(joined.labels), np.bincount(old.labels))
        for column in COLUMNS:
            np.testing.assert_array_equal(joined.of(column)[joined.labels == number], new.of(column))
            np.testing.assert_array_equal(joined.of(column)[joined.labels != number],
                                          old.of(column)[old.labels != number])
    assert wanted_inside(18, 18)['triangles training'].patterns == many


def test_what_is_drawn_does_not_depend_on_the_number_of_processes():
    wanted = {'a': Wanted('benchmark', Purpose.TEST, 260, (20, 40)),
              'b': Wanted('one proportion', Purpose.TEST, 5, (30, 30))}
    one, two = (draw(wanted, 3, jobs) for jobs in (1, 2))
    for name in wanted:
        assert len(one[name].every.labels) == wanted[name].patterns
        for column in COLUMNS:
            np.testing.assert_array_equal(one[name].kept.of(column), two[name].kept.of(column))
    assert len(set(one['a'].every.of(('dif', 'alpha9')))) > 200, 'batches repeat each other'


def test_nearest_neighbours_separate_clusters():
    rng = np.random.default_rng(0)

    def samples(count):
        labels = np.arange(count) % 5
        return Samples({column: (1 + labels) * rng.uniform(0.95, 1.05, count) for column in COLUMNS}, labels)

    learner, fresh = NearestNeighbours(samples(300), samples(50)), samples(50)
    assert (learner.answers(fresh) == fresh.labels).all()


@pytest.mark.slow
def test_a_small_run_writes_page_and_numbers(tmp_path, capsys):
    folder = tmp_path / 'out'
    arguments = ['-o', str(folder), '--patterns', '15', '--training', '600', '--jobs', '1']
    assert main(arguments) == 0
    page = (folder / 'index.html').read_text(encoding='utf-8')
    assert page.count('<img ') == page.count('data:image/svg+xml;base64,') == 12
    assert not re.search(r'(src|href)="(?!data:)', page), 'the page needs something else'
    with open(folder / 'rates.csv', encoding='utf-8', newline='') as stream:
        rows = list(csv.DictReader(stream))
    assert {row['area'] for row in rows} == {'15', '20', '25', '30', '35', '50', '75', '100'}
    for row in rows:
        assert float(row['low95']) <= float(row['recognised']) <= float(row['high95'])
        assert f'{float(row["recognised"]):.1%}' in page and row['method'] in page
    _check_inside_reading(folder, page)
    assert rows[0]['method'].startswith('as published') and rows[0]['patterns'] == '15'
    assert capsys.readouterr().err == '', 'a bar is for a terminal'
    assert main(arguments) == 2
    assert '--force' in capsys.readouterr().err


def _check_inside_reading(folder, page):
    with open(folder / 'inside.csv', encoding='utf-8', newline='') as stream:
        share = {(row['method'], row['N']): float(row['recognised']) for row in csv.DictReader(stream)}
    with open(folder / 'rates.csv', encoding='utf-8', newline='') as stream:
        published = {row['area']: float(row['recognised']) for row in csv.DictReader(stream)
                     if row['method'].startswith('as published')}
    for size, goal in (('20', 70), ('35', 90), ('100', 99.9)):
        both, before = (100 * value for value in (share['N inside taxels, equilateral triangles', size],
                                                  published[size]))
        said = re.search(rf'N = {size}: .*? so that ([-.0-9]+) points .*? both ([-+.0-9]+) ± .*?; ([-.0-9]+) remain',
                         page)
        assert [float(number) for number in said.groups()] == pytest.approx(
            [goal - before, both - before, goal - both], abs=0.051)


@pytest.mark.parametrize('wrong', [['--patterns', '3'], ['--training', '10'], ['--jobs', '0'], ['--seed', '-1']])
def test_arguments_out_of_range_are_refused(wrong, tmp_path, capsys):
    assert main(['-o', str(tmp_path), *wrong]) == 2
    assert 'Ask for more' in capsys.readouterr().err
