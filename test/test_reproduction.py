"""`make reproduce`: statistics worked out by hand, the simulated data, and a small complete run."""

import csv
import re

import numpy as np
import pytest

from bench import reproduce
from bench.reproduce import main
from bench.reproduction import sampling
from bench.reproduction.methods import confusion, lost_in_plane
from bench.reproduction.sampling import Wanted, draw, plane_features
from tactile_node.helmholtz.features import Group, compute_features
from tactile_node.shape.volf import plane_feature
from training.curve_fitting import COLUMNS
from training.ground_truth.seeds import Purpose, generator, random_pattern


def test_the_first_wrong_decision_bears_the_loss():
    """The classes are rectangle, right triangle (plane 1), isosceles triangle (plane 2), square, circle (plane 3)."""
    labels = np.array([0, 1, 2, 2, 3, 4, 4, 4])
    answer = np.array([1, 1, 0, 4, 4, 2, 3, 4])
    assert lost_in_plane(answer, labels) == {1: 2 / 8, 2: 2 / 8, 3: 2 / 8}
    assert confusion(answer, labels)[4].tolist() == pytest.approx([0, 0, 1 / 3, 1 / 3, 1 / 3])


def test_features_over_all_angles_are_those_of_the_classifier():
    mask = random_pattern(generator(Purpose.TEST, 20), 'square', 60)
    features = compute_features(mask, Group.CLASSIFIER)
    assert plane_features(mask)[:6] == [plane_feature(features, column) for column in COLUMNS]


@pytest.mark.slow
def test_the_drawn_patterns_do_not_depend_on_the_number_of_processes(monkeypatch):
    monkeypatch.setattr(sampling, 'BATCH', 20)
    wanted = {'a': Wanted('benchmark', Purpose.TEST, 50, (20, 40)),
              'b': Wanted('one proportion', Purpose.TEST, 5, (30, 30))}
    one, two = (draw(wanted, 3, jobs) for jobs in (1, 2))
    for name in wanted:
        assert len(one[name].every.labels) == wanted[name].patterns
        for column in COLUMNS:
            np.testing.assert_array_equal(one[name].kept.of(column), two[name].kept.of(column))
    assert len(set(one['a'].every.of(('dif', 'alpha9')))) > 30, 'the batches repeat each other'


@pytest.mark.slow
def test_a_small_run_writes_page_and_numbers(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(reproduce, 'LEAST_TRAINING', 200)
    folder = tmp_path / 'out'
    arguments = ['-o', str(folder), '--patterns', '15', '--training', '200', '--jobs', '1']
    assert main(arguments) == 0
    page = (folder / 'index.html').read_text(encoding='utf-8')
    assert page.count('<img ') == page.count('data:image/svg+xml;base64,') == 10
    assert not re.search(r'(src|href)="(?!data:)', page), 'the page must not need another file'
    with open(folder / 'rates.csv', encoding='utf-8', newline='') as stream:
        rows = list(csv.DictReader(stream))
    assert {row['area'] for row in rows} == {'15', '20', '25', '30', '35', '50', '75', '100'}
    for row in rows:
        assert float(row['low95']) <= float(row['recognised']) <= float(row['high95'])
        assert f'{float(row["recognised"]):.1%}' in page and row['method'] in page
    assert rows[0]['method'].startswith('as published') and rows[0]['patterns'] == '15'
    assert capsys.readouterr().err == '', 'only a terminal gets a progress bar'
    assert main(arguments) == 2
    assert '--force' in capsys.readouterr().err


@pytest.mark.parametrize('wrong', [['--patterns', '3'], ['--training', '10'], ['--jobs', '0'], ['--seed', '-1']])
def test_arguments_out_of_range_are_refused(wrong, tmp_path, capsys):
    assert main(['-o', str(tmp_path), *wrong]) == 2
    assert 'Give larger numbers' in capsys.readouterr().err
