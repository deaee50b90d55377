"""The reference that `make docs` generates must be complete. This test does not need Sphinx."""

import re
from pathlib import Path

import from_code
import pytest
from from_code import interfaces, parameters

from tactile_node.ros.parameters import table

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / 'docs'


def rows(text: str) -> list[list[str]]:
    """Return the cells of all tables in the reference."""
    lines = [line for line in text.splitlines() if line.startswith('| ') and not line.startswith('| ---')]
    return [[cell.strip() for cell in re.split(r'(?<!\\)\|', line)[1:-1]] for line in lines]


@pytest.mark.parametrize('node', parameters.NODES)
def test_every_parameter_of_a_node_is_in_its_table(node):
    own = parameters.markdown().split(f'## {node}\n')[1].split('\n## ')[0]
    common = parameters.markdown().split('\n## ')[0]
    listed = {row[0].strip('`'): row for row in rows(own) + rows(common)}
    for row in table(parameters.NODES[node]):
        assert row.properties.description == listed[row.name][4].replace('\\', '')
        assert (listed[row.name][3] == 'yes') == row.properties.live
    assert len(rows(own)) + len(rows(common)) - 2 == len(table(parameters.NODES[node]))


def test_a_comment_belongs_to_the_field_beside_it(tmp_path):
    path = tmp_path / 'Some.msg'
    path.write_text('# What it is. More.\n\n# Of both.\nfloat64 x  # along rows [m]\n           # and columns\n'
                    'uint8 A=1\nstring<=4[] names "x"\n', encoding='utf-8')
    assert rows(interfaces.page_part(path))[1:] == [
        ['`float64`', '`x`', 'm', 'along rows and columns'], ['`uint8`', '`A = 1`', '', ''],
        ['`string<=4[]`', '`names`', '', '']]
    assert interfaces.first_sentence(path) == 'What it is'


def test_every_mark_of_a_page_has_a_generator_and_every_generator_a_page():
    pages = [*DOCS.rglob('*.md'), DOCS / 'index.rst']
    named = [name for page in pages for name in from_code.MARK.findall(page.read_text(encoding='utf-8'))]
    assert sorted(named) == sorted(from_code.GENERATORS)


def test_the_page_names_a_module_that_is_missing(monkeypatch):
    def lacks(name):
        raise ModuleNotFoundError(name='rclpy')
    monkeypatch.setattr(from_code, 'import_module', lacks)
    assert from_code.filled('a <!-- from the code: graph --> b', lambda name, error: f'{name}, {error.name}') \
        == 'a graph, rclpy b'
