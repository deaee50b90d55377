"""`tactile reproduce`: its statistics by hand, its worlds, and a whole small run."""

import csv
import re

import numpy as np
import pytest

from tactile_node.cli.main import main
from tactile_node.helmholtz.features import compute_features
from tactile_node.reproduction.curve_fitting import COLUMNS, Samples
from tactile_node.reproduction.neighbours import NearestNeighbours
from tactile_node.reproduction.rates import confusion, lost_in_plane, rate
from tactile_node.reproduction.sampling import Wanted, draw, plane_features
from tactile_node.reproduction.worlds import WORLDS, draw_pattern
from tactile_node.shape.volf import GROUPS, plane_feature
from tactile_node.synthetic.seeds import Purpose, generator
from tactile_node.synthetic.world import CLASSES, random_pattern


def test_wilson_interval_of_a_textbook_case():
    """8 of 10: 0.4902 to 0.9433 (A. Agresti, B. Coull 1998); all right is not certainty."""
    found = rate(np.arange(10) < 8)
    assert (found.share, found.patterns) == (0.8, 10)
    assert (found.low, found.high) == pytest.approx((0.4902, 0.9433), abs=5e-5)
    assert rate(np.ones(100, bool)).low == pytest.approx(100 / (100 + 1.96 ** 2), abs=1e-4)


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


def test_what_is_drawn_does_not_depend_on_the_number_of_processes():
    wanted = {'a': Wanted('benchmark', Purpose.TEST, 260, (20, 40)),
              'b': Wanted('one proportion', Purpose.TEST, 5, (30, 30))}
    one, two = (draw(wanted, 3, jobs, lambda text: None) for jobs in (1, 2))
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
    assert main(['reproduce', '-o', str(folder), '--patterns', '15', '--training', '600', '--jobs', '1']) == 0
    page = (folder / 'index.html').read_text(encoding='utf-8')
    assert page.count('<img ') == page.count('data:image/svg+xml;base64,') == 10
    assert not re.search(r'(src|href)="(?!data:)', page), 'the page needs something else'
    with open(folder / 'rates.csv', encoding='utf-8', newline='') as stream:
        rows = list(csv.DictReader(stream))
    assert {row['area'] for row in rows} == {'15', '20', '25', '30', '35', '50', '75', '100'}
    for row in rows:
        assert float(row['low95']) <= float(row['recognised']) <= float(row['high95'])
        assert f'{float(row["recognised"]):.1%}' in page and row['method'] in page
    assert rows[0]['method'].startswith('as published') and rows[0]['patterns'] == '15'
    assert 'patterns drawn: 100%' in capsys.readouterr().err


@pytest.mark.parametrize('wrong', [['--patterns', '3'], ['--training', '10'], ['--jobs', '0'], ['--seed', '-1']])
def test_arguments_out_of_range_are_refused(wrong, tmp_path, capsys):
    assert main(['reproduce', '-o', str(tmp_path), *wrong]) == 2
    assert 'Ask for more' in capsys.readouterr().err
