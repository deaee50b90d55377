"""The reference that `make docs` generates lacks nothing of the code; no Sphinx is needed."""

import argparse
import re
from pathlib import Path

import from_code
import pytest
from from_code import command_line, interfaces, layout_keys, library, parameters
from rosidl_adapter import parser

import tactile_node
from tactile_node.cli.main import COMMANDS
from tactile_node.ros.parameters import table

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / 'docs'
INTERFACES = [path for folder in ('msg', 'srv', 'action') for path in sorted((ROOT / folder).glob(f'*.{folder}'))]


def rows(text: str) -> list[list[str]]:
    """The cells of all tables."""
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


def declared(path: Path) -> set[str]:
    """Names of all constants and fields, by ROS's own parser."""
    kinds = {'.msg': parser.parse_message_file, '.srv': parser.parse_service_file,
             '.action': parser.parse_action_file}
    whole = kinds[path.suffix]('tactile_skin', str(path))
    parts = {'.msg': ['']}.get(path.suffix, ['request', 'response'] if path.suffix == '.srv' else
                               ['goal', 'result', 'feedback'])
    specifications = [getattr(whole, part) if part else whole for part in parts]
    return {each.name for part in specifications for each in (*part.fields, *part.constants)}


@pytest.mark.parametrize('path', INTERFACES, ids=lambda path: path.stem)
def test_every_field_and_every_word_of_its_comment_is_there(path):
    part = interfaces.page_part(path)
    assert {row[1].strip('`').split(' = ')[0] for row in rows(part) if row[1].startswith('`')} == declared(path)
    words = {word for line in path.read_text(encoding='utf-8').splitlines() if '#' in line
             for word in re.findall(r'\w{3,}', line.split('#', 1)[1])}
    assert words <= set(re.findall(r'\w{3,}', part))


def test_a_comment_belongs_to_what_it_stands_beside(tmp_path):
    path = tmp_path / 'Some.msg'
    path.write_text('# What it is. More.\n\n# Of both.\nfloat64 x  # along rows [m]\n           # and columns\n'
                    'uint8 A=1\nstring<=4[] names "x"\n', encoding='utf-8')
    assert rows(interfaces.page_part(path))[1:] == [
        ['`float64`', '`x`', 'm', 'along rows and columns'], ['`uint8`', '`A = 1`', '', ''],
        ['`string<=4[]`', '`names`', '', '']]
    assert interfaces.first_sentence(path) == 'What it is'


@pytest.mark.parametrize('name', [name for name, *_ in COMMANDS])
def test_every_option_of_a_command_is_there(name):
    whole = command_line.markdown().split(f'\n\n## tactile {name}\n')[-1].split('\n## ')[0]

    def check(parser: argparse.ArgumentParser) -> None:
        for action in parser._actions:
            assert all(re.search(rf'{option}(?![\w-])', whole) for option in action.option_strings)
            for below in action.choices.values() if isinstance(action, argparse._SubParsersAction) else ():
                check(below)
    check(command_line.parser_of(name))


def test_every_key_of_a_layout_and_every_name_of_the_library_is_there():
    listed = {row[0].strip('`') for row in rows(layout_keys.markdown())}
    examples = ''.join(path.read_text(encoding='utf-8') for path in (ROOT / 'config').glob('*x*.yaml'))
    keys = set(re.findall(r'^(?:- )? *(\w+):', examples, re.MULTILINE)) | set(re.findall(r'[{,] *(\w+): ', examples))
    assert len(keys) > 20 and keys - {'first', 'step'} <= listed
    documented = set(re.findall(r'tactile_node\.(\w+)$', library.markdown(), re.MULTILINE))
    assert documented == set(tactile_node.__all__) - {'__version__'}


def test_every_mark_of_a_page_has_a_generator_and_every_generator_a_page():
    pages = [*DOCS.rglob('*.md'), DOCS / 'index.rst']
    named = [name for page in pages for name in from_code.MARK.findall(page.read_text(encoding='utf-8'))]
    assert sorted(named) == sorted(from_code.GENERATORS)


def test_what_the_code_lacks_is_said_in_the_page(monkeypatch):
    def lacks(name):
        raise ModuleNotFoundError(name='rclpy')
    monkeypatch.setattr(from_code, 'import_module', lacks)
    assert from_code.filled('a <!-- from the code: graph --> b', lambda name, error: f'{name}, {error.name}') \
        == 'a graph, rclpy b'
