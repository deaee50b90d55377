"""docs/tutorial.md leads a newcomer to a shape on a topic: its commands are run as they stand there."""

import shlex
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import documented_commands as documented
import pytest

ROOT = Path(__file__).resolve().parents[1]
pytestmark = [pytest.mark.ros, pytest.mark.bus]
PAGE = (ROOT / 'docs/tutorial.md').read_text(encoding='utf-8')
TIMEOUT = 60.0  # s, for a busy machine


def started(stack: ExitStack, beginning: str, link: Path) -> subprocess.Popen:
    """Start the command of the page that begins so, its link in a folder of the test; ends with ``stack``."""
    text, = (each.text for each in documented.commands_of(PAGE, 'docs/tutorial.md')
             if each.text.startswith(beginning) and not each.in_sentence)
    program, *words = shlex.split(text.replace('/tmp/skin', str(link)))
    module = ['-m', 'tactile_node.cli.main'] if program == 'tactile' else []
    process = subprocess.Popen([sys.executable, *module, *words], cwd=ROOT, text=True, stdout=subprocess.PIPE,
                               stderr=subprocess.DEVNULL)

    def end() -> None:
        process.terminate()
        process.wait(TIMEOUT)
        process.stdout.close()
    stack.callback(end)
    return process


def test_a_newcomer_gets_a_shape_on_a_topic(tmp_path):
    link = tmp_path / 'skin'
    with ExitStack() as stack:
        started(stack, 'tactile simulate', link)
        deadline = time.monotonic() + TIMEOUT
        while not link.is_symlink():
            assert time.monotonic() < deadline
            time.sleep(0.02)
        started(stack, 'tactile bringup', link)
        listener = started(stack, 'python examples/shape_listener.py', link)
        seen = ''
        for line in listener.stdout:
            seen += line
            if 'mm' in line:
                break
    name, confidence, rest = seen.splitlines()[-1].split(maxsplit=2)
    assert name in ('circle', 'square', 'rectangle', 'right_triangle', 'isosceles_triangle')
    assert 50 < int(confidence) <= 100 and rest.startswith('%') and 'mm' in rest
