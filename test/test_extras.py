"""Tests that every extra named in an error or on a page exists and installs the missing modules."""

import configparser
import re
import sys
from pathlib import Path

import pytest

from tactile_node.cli.main import COMMANDS, NEEDS, main

ROOT = Path(__file__).resolve().parents[1]
#: Matches, for example, tactile-skin[picture] and '.[picture,bag]'.
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


def test_the_help_lists_each_command_once_and_marks_those_whose_modules_are_missing(monkeypatch, capsys):
    for module in ('rclpy', 'viser'):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(SystemExit):
        main(['--help'])
    first, more = ([line for line in part.splitlines() if line.startswith('    ')]
                   for part in capsys.readouterr().out.split('More:'))
    names = [line.split()[0] for line in first + more]
    assert len(first) == 11 and sorted(names) == sorted([name for name, _ in COMMANDS] + ['--version'])
    missing = {line.split()[0]: re.findall('rclpy|viser', line) for line in first + more}
    assert {name: found for name, found in missing.items() if found} == {'bringup': ['rclpy'], 'view': ['viser'],
                                                                               'tare': ['rclpy'],
                                                                               'commission': ['rclpy']}
