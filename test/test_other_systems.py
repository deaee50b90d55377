"""On Windows, the library and the commands run without ROS, and without the Python modules that exist only on Linux.

The command `simulate` reports that it does not work on Windows.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tactile_node.cli.main import COMMANDS

pytestmark = pytest.mark.slow
ROOT = Path(__file__).resolve().parents[1]
#: Windows lacks these modules. Python on Windows has pty and tty, but they fail without termios. pyserial works on
#: Windows, so the test imports it first.
WINDOWS = """
import os, serial, signal, sys
for name in ('termios', 'fcntl', 'resource', 'grp', 'pwd', 'readline', 'rclpy', 'tactile_skin', 'std_msgs'):
    sys.modules[name] = None
for name in ('pread', 'pwrite', 'pidfd_open', 'ttyname', 'openpty', 'O_NOCTTY', 'O_NONBLOCK', 'mkfifo', 'getuid'):
    delattr(os, name)
del signal.SIGUSR1, signal.SIGKILL
from tactile_node.cli.main import COMMANDS, main
"""
HELP = """
for name, _ in COMMANDS:
    try:
        print('CODE', name, main([name, '--help']))
    except SystemExit as end:
        print('CODE', name, end.code)
"""


def run(program: str, folder: Path) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, '-c', WINDOWS + program], cwd=folder, capture_output=True, text=True,
                          timeout=120, env={**os.environ, 'PYTHONPATH': str(ROOT)}, check=False)


def test_the_lines_of_the_readme_replay_and_classify_run(tmp_path):
    done = run(f'import doctest; print(doctest.testfile({str(ROOT / "README.md")!r}, module_relative=False))\n'
               f'main(["replay", {str(ROOT / "test/data/sim16x16_two_pads.log.gz")!r}, "--output", "frames.npz"])\n'
               'sys.exit(main(["classify", "frames.npz", "--pitch", "0.004"]))', tmp_path)
    assert done.returncode == 0, done.stderr
    assert 'TestResults(failed=0, attempted=6' in done.stdout, done.stdout
    lines = [json.loads(line) for line in done.stdout.splitlines() if line.startswith('{')]
    assert {'circle', 'square'} <= {line['shape'] for line in lines}


def test_each_command_shows_its_help_or_says_what_it_needs(tmp_path):
    done = run(HELP, tmp_path)
    codes = dict(line.split()[1:] for line in done.stdout.splitlines() if line.startswith('CODE'))
    assert codes == {name: '2' if name == 'simulate' else '0' for name, _ in COMMANDS}, done.stderr
    assert done.stderr == ('tactile: error: simulate needs the Python module termios, which is missing. '
                           'Python has this module only on Linux and macOS. Run the command there.\n')
