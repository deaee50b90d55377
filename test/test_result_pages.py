"""Each results page must equal the output of its script for the recorded tables.

A results page must not be edited by hand.
"""

from pathlib import Path

import pytest

from bench import pose_summary
from bench.recognition import summary
from bench.recognition.views import View, across, lines_of, of, value

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize('page, folder', [
    *((page, 'docs/recognition') for page in summary.PAGES), (pose_summary.PAGE, 'docs')])
def test_a_page_equals_the_output_of_its_script_for_the_recorded_tables(page, folder):
    assert page.text(ROOT / folder) == (ROOT / folder / page.file).read_text(encoding='utf-8')


def test_equal_rows_become_one_and_values_in_one_cell_are_joined():
    view = View('', '', '', ('shape',), across('area', of('ours')))
    rows = [{'shape': shape, 'area': area, 'ours': f'{rate} (0-9)'}
            for shape, area, rate in (('L', '12', 1), ('arc', '12', 2), ('L', '20', 3), ('L', '20', 4))]
    assert lines_of(view, rows)[2:] == ['| L | 1 | 3 / 4 |', '| arc | 2 |  |']


def test_rates_below_the_requirement_are_bold_and_rates_below_an_anchor_are_marked():
    assert value({'ours': '97.50 (96.00-98.00)', 'required': 'NOT MET'}, 'ours') == '**97.50**'
    assert value({'ours': '97.50 (96.00-98.00)', 'ours against the better': 'BELOW'}, 'ours') == '97.50*'
    assert value({'CNN': '99.00 (98.00-99.50)', 'ours against the better': 'BELOW'}, 'CNN') == '99.00'
