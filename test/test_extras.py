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
