"""Tests that the examples run the bus side as a service and in a container.

systemd ignores unknown lines in a unit. `systemd-analyze verify` prints unknown lines but returns 0, so a reader who
copies the unit would not notice them.
"""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tactile_node.cli.bringup import describe_nodes
from tactile_node.cli.main import _parser

EXAMPLES = Path(__file__).resolve().parents[1] / 'examples'
CONTAINER = EXAMPLES / 'container'
UNIT = EXAMPLES / 'tactile_bus.service'


def program(name: str) -> str:
    """Return the path of a program next to this Python or on the PATH, or skip the test if the program is missing."""
    found = shutil.which(name, path=str(Path(sys.executable).parent)) or shutil.which(name)
    return found or pytest.skip(f'{name} is not installed')


def run(*words):
    return subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False, timeout=60)


def complaints(unit: Path) -> list[str]:
    """Return systemd's messages about this unit, leaving out those about other units on this machine."""
    done = run(program('systemd-analyze'), 'verify', '--man=no', unit)
    return [line for line in done.stderr.splitlines() if unit.name in line]


def compose() -> dict:
    return yaml.safe_load((CONTAINER / 'compose.yaml').read_text(encoding='utf-8'))['services']['tactile_bus']


def words_of_unit() -> list[str]:
    command = UNIT.read_text(encoding='utf-8').split('exec tactile bringup', 1)[1].split("'", 1)[0]
    return shlex.split(command.replace('\\\n', ' '))


def words_of_image() -> list[str]:
    command, = re.findall(r'^CMD (\[.*\])$', (CONTAINER / 'Dockerfile').read_text(encoding='utf-8'), re.MULTILINE)
    return yaml.safe_load(command)


@pytest.mark.parametrize('unit', sorted(EXAMPLES.glob('*.service')), ids=lambda path: path.name)
def test_systemd_reads_every_line_of_a_unit(unit):
    assert complaints(unit) == []


@pytest.mark.parametrize('words', [words_of_unit(), words_of_image(), compose()['command']])
def test_each_service_starts_only_the_driver_and_waits_for_its_bus(words):
    driver, = describe_nodes(_parser('bringup').parse_args(['bringup', *words]), '')
    assert driver.label == 'skin_driver' and driver.parameters.get('wait_at_start', True)
    assert len(driver.parameters['pads']) == len(driver.parameters['node_ids'])


def test_the_entrypoint_is_a_script_that_leaves_one_process():
    assert run('bash', '-n', CONTAINER / 'entrypoint.sh').returncode == 0
    assert (CONTAINER / 'entrypoint.sh').read_text(encoding='utf-8').splitlines()[-1].startswith('exec tactile ')
