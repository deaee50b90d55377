"""Tests that every command in the documents works.

Each command either runs here or has a rule that states what the command needs.
"""

import glob
import gzip
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import documented_commands as documented
import numpy as np
import pytest
from command_rules import HERE, RULES, CommandKind
from matplotlib import pyplot
from waiting import until

from tactile_node.cli.main import main

ROOT = Path(__file__).resolve().parents[1]
LINK = '/tmp/skin'  # The documents use this path.
LOG = 'test/data/sim16x16_two_pads.log.gz'
TIMEOUT = 60.0  # Timeout for a simulator, long enough for a busy machine [s].
ALL = documented.commands()


@pytest.mark.parametrize('text', [
    'tactile check', 'tactile check --jsn x.yaml', 'tactile see x.yaml', 'tactile scan --listen long',
    'make tests', 'python bench/no_such_file.py', 'ros2 launch tactile_skin bringup.launch.py no_such:=1'])
def test_a_command_that_does_not_exist_is_a_problem(text):
    assert documented.problem(documented.DocumentedCommand('page', 1, text, False))


@pytest.mark.parametrize('page', sorted({each.page for each in ALL}))
def test_every_command_has_a_class_and_names_what_exists(page):
    for command in ALL:
        if command.page == page:
            assert command.rule and not documented.problem(command), command


def test_the_tests_that_rules_name_exist_and_run_such_a_command():
    for rule in RULES:
        if rule.kind is CommandKind.TESTED:
            program, word = rule.pattern.replace('3?', '').removeprefix('^').split(' ')[:2]
            name = word.split('.*')[0] if program == 'tactile' else word.split('/')[-1].removesuffix('.py')
            assert name in (ROOT / rule.where).read_text(encoding='utf-8'), rule


RUN = [each for each in ALL if each.rule and each.rule.kind is CommandKind.RUN]
SKIN = f'tactile simulate --pty --link {LINK}'


def pages_with_new_commands() -> list[str]:
    """Return the pages with at least one command that no earlier page contains."""
    first = {each.text: each.page for each in reversed(RUN)}
    return sorted(set(first.values()))


@pytest.mark.bus
@pytest.mark.parametrize('page', pages_with_new_commands())
def test_the_commands_of_a_page_work_in_their_order(page, tmp_path, monkeypatch, capsys):
    assert Path(__file__).name == Path(HERE).name
    (tmp_path / 'test').symlink_to(ROOT / 'test')
    (tmp_path / 'session.log').write_bytes(gzip.decompress((ROOT / LOG).read_bytes()))
    pyplot.imsave(tmp_path / 'frame.png', np.pad(np.ones((7, 7)), 4), cmap='gray')
    (tmp_path / 'my_skin.eds').write_bytes((ROOT / 'config/sim16x16.eds').read_bytes())
    monkeypatch.chdir(tmp_path)
    texts = [each.text for each in RUN if each.page == page]
    of_skin = [text for text in texts if LINK in text]
    assert SKIN not in of_skin or of_skin[0] == SKIN, 'the skin must run before the commands that need it'
    with ExitStack() as stack:
        if any(LINK in text and 'simulate' not in text for text in texts):
            stack.enter_context(simulated(SKIN.replace(LINK, 'skin')))
            texts = [text for text in texts if text != SKIN]  # The simulated skin is already running.
        for text in texts:
            if 'simulate' in text:
                with simulated(text.replace(LINK, 'other')):
                    continue
            words = shlex.split(text.replace(LINK, 'skin'))[1:]
            assert main([name for word in words for name in sorted(glob.glob(word)) or [word]]) == 0, text
            assert capsys.readouterr().out or '--output' in text
            if 'draft' in text:  # The reader of the page fills in the values that no EDS contains.
                (tmp_path / 'my_skin.yaml').write_bytes((ROOT / 'config/sim16x16.yaml').read_bytes())


@contextmanager
def simulated(text: str) -> Iterator[None]:
    """Run a simulator in the background, and enter the context once the link exists."""
    words = shlex.split(text)[1:]
    skin = subprocess.Popen([sys.executable, '-m', 'tactile_node.cli.main', *words], stdout=subprocess.DEVNULL)
    try:
        link = Path(words[words.index('--link') + 1])
        until(lambda: link.is_symlink() or skin.poll() is not None, TIMEOUT)
        assert skin.poll() is None
        yield
    finally:
        skin.terminate()
        assert skin.wait(TIMEOUT) == 0


def test_make_help_lists_each_target_once_and_ten_of_them_first():
    text = subprocess.run(['make', 'help'], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    first, more = ([line.split()[0] for line in part.splitlines() if re.match(r'    [a-z-]+ +\S', line)]
                   for part in text.split('Other targets:'))
    targets = re.findall(r'^([a-z-]+):.*## ', (ROOT / 'Makefile').read_text(encoding='utf-8'), re.MULTILINE)
    assert len(first) == 10 and first[0] == 'demo' and sorted(first + more) == sorted(targets)
