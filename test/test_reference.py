"""The pages in docs/reference/ must be complete, and must agree with the code."""

import re
import sys
from pathlib import Path
from textwrap import dedent

import pytest
import write_reference
from reference import interfaces, library, parameters

from tactile_node.ros.parameters import table


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


@pytest.mark.skipif(sys.version_info >= (3, 13), reason='argparse of Python 3.13 prints the options in another form')
@pytest.mark.parametrize('page', [
    pytest.param(page, marks=pytest.mark.ros if page.stem == 'topics' else (), id=page.stem)
    for page in write_reference.PAGES])
def test_a_page_says_what_the_code_says(page):
    """`make reference` writes the pages."""
    text = page.read_text(encoding='utf-8')
    assert write_reference.page_text(text) == text


def test_every_generator_has_a_page():
    named = [name for page in write_reference.PAGES
             for name in write_reference.MARK.findall(page.read_text(encoding='utf-8'))]
    generators = {path.stem for path in Path(interfaces.__file__).parent.glob('*.py')}
    assert sorted(named) == sorted(generators - {'__init__', 'markdown'})


def test_the_library_page_shows_the_signature_and_the_docstring_but_not_the_body():
    class Thing:
        """A thing."""

        #: its size [m]
        size: float

        def grow(self, by: float = 1.0) -> float:
            """Make it larger."""
            return self.size + by

        def _hidden(self):
            pass

    assert library.outline(Thing) == dedent('''\
        class Thing:
            """A thing."""

            #: its size [m]
            size: float

            def grow(self, by: float = 1.0) -> float:
                """Make it larger."""''')
