"""Tests that a shell completes the commands of `tactile` and the options of the typed command."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tactile_node.cli.main import COMMANDS, chosen_command

ROOT = Path(__file__).resolve().parents[1]
HEAVY = 'scipy', 'rclpy', 'matplotlib', 'can', 'canopen'


def asked(line, *words):
    """Return the variables that a shell sets to complete ``line`` for a program that is started with ``words``."""
    return {'COMP_LINE': line, 'COMP_POINT': str(len(line)), '_ARGCOMPLETE': str(len(words) or 1)}


@pytest.mark.parametrize(('line', 'chosen'), [
    ('tactile ', ''), ('tactile cl', ''), ('tactile classify', ''), ('tactile classify ', 'classify'),
    ('tactile classify --pi', 'classify'), ('tactile   replay x.log --output ', 'replay'), ('tactile --ver', ''),
    ('tactile tactile ', 'tactile'), ('', '')])
def test_the_command_is_the_first_word_that_is_complete(line, chosen):
    assert chosen_command(asked(line)) == chosen


@pytest.mark.bus
@pytest.mark.parametrize(('line', 'expected', 'others'), [
    ('tactile ', {name for name, *_ in COMMANDS} | {'--version'}, {'--pitch'}),
    ('tactile classify --p', {'--pitch', '--period', '--press'}, {'--pads'}),
    ('tactile classify --method ', {'learned', 'volf'}, set()),
    ('tactile features --largest', {'--largest-contact'}, set())])
def test_a_shell_gets_the_completions_without_waiting_for_imports(tmp_path, line, expected, others):
    """A slow import would delay every press of the TAB key."""
    code = ('import os, sys; from tactile_node.cli.main import program\n'
            f'ended = lambda status: (print(*(set({HEAVY}) & set(sys.modules)), file=open("imported", "w")), '
            'os.kill(os.getpid(), 9))\nos._exit = ended\nprogram()')
    environment = os.environ | asked(line) | {'_ARGCOMPLETE_STDOUT_FILENAME': str(tmp_path / 'found'),
                                              '_ARGCOMPLETE_IFS': '\n', 'PYTHONPATH': str(ROOT)}
    subprocess.run([sys.executable, '-c', code], env=environment, cwd=tmp_path, check=False, timeout=60)
    found = {word.strip() for word in (tmp_path / 'found').read_text().splitlines()}
    assert expected <= found and not others & found
    assert (tmp_path / 'imported').read_text().split() == []


@pytest.mark.bus
@pytest.mark.skipif(shutil.which('bash') is None, reason='no bash')
def test_bash_completes_after_the_line_of_the_page(tmp_path):
    program = tmp_path / 'tactile'
    program.write_text(f'#!/bin/sh\nPYTHONPATH={ROOT} exec {sys.executable} -m tactile_node.cli.main "$@"\n')
    program.chmod(0o755)
    line = 'tactile classify --full'
    script = (f'eval "$(register-python-argcomplete tactile)"; COMP_LINE="{line}"; COMP_POINT={len(line)}; '
              'COMP_TYPE=9; COMP_WORDS=(tactile classify --full); COMP_CWORD=2\n'
              '$(complete -p tactile | sed "s/.*-F \\([^ ]*\\).*/\\1/") tactile --full classify\n'
              'echo "${COMPREPLY[@]}"')
    result = subprocess.run(['bash', '-c', script], env=os.environ | {'PATH': f'{tmp_path}:{os.environ["PATH"]}'},
                            capture_output=True, text=True, timeout=60, check=False)
    assert result.stdout.split() == ['--full-scale'], result.stderr
