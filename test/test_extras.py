"""Extras that an error or a page names exist, and bring the modules that are missing."""

import configparser
import re
import sys
from pathlib import Path

import pytest

from tactile_node.cli.main import NEEDS, main

ROOT = Path(__file__).resolve().parents[1]
#: tactile-skin[picture], '.[picture,bag]'
NAMED = re.compile(r"(?:tactile-skin|\B\.)\[([a-z]+(?:, ?[a-z]+)*)\]")


def extras():
    config = configparser.ConfigParser()
    config.read(ROOT / 'setup.cfg')
    return {name: value.split() for name, value in config['options.extras_require'].items()}


def named(*folders):
    """Extra -> files that name it."""
    found = {}
    for folder in folders:
        paths = [folder] if folder.is_file() else [path for path in folder.rglob('*') if path.suffix in ('.py', '.md')]
        for path in paths:
            for names in NAMED.findall(path.read_text(encoding='utf-8')):
                for name in names.replace(' ', '').split(','):
                    found.setdefault(name, []).append(path)
    return found


def test_every_extra_that_is_named_exists():
    found = named(ROOT / 'tactile_node', ROOT / 'examples', ROOT / 'docs', ROOT / 'README.md')
    assert {'picture', 'bag', 'completion'} <= set(found), 'the pattern finds what is there'
    assert set(found) <= set(extras())


def test_a_module_that_an_error_sends_to_an_extra_comes_with_it():
    libraries = {'matplotlib': 'matplotlib', 'PIL': 'pillow', 'argcomplete': 'argcomplete', 'viser': 'viser'}
    for module, remedy in NEEDS.items():
        for extra in NAMED.findall(remedy):
            assert libraries[module] in extras()[extra], module


def test_the_help_marks_the_commands_whose_modules_are_missing(monkeypatch, capsys):
    for module in ('rclpy', 'viser'):
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setenv('COLUMNS', '200')
    with pytest.raises(SystemExit):
        main(['--help'])
    lines = capsys.readouterr().out.replace('\n' + 14 * ' ', ' ').splitlines()  # a long name has its text below
    missing = {line.split()[0]: re.findall('rclpy|viser', line) for line in lines if line.startswith('    ')}
    assert {name: found for name, found in missing.items() if found} == {'bringup': ['rclpy'], 'view': ['viser']}
