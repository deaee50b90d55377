"""The examples that run the bus side as a service and in a container are what their readers take them for.

Misled would be who copies a unit of which systemd ignores a line: `systemd-analyze verify` prints that and returns 0.
"""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tactile_node.cli.bringup import described
from tactile_node.cli.main import _parser

EXAMPLES = Path(__file__).resolve().parents[1] / 'examples'
CONTAINER = EXAMPLES / 'container'
UNIT = EXAMPLES / 'tactile_bus.service'
MOST_EXPOSED = 20  # tenths, of systemd-analyze security; tactile_skin.service has 92


def program(name: str) -> str:
    """Beside this Python or on the PATH; the test is skipped where it is on neither."""
    found = shutil.which(name, path=str(Path(sys.executable).parent)) or shutil.which(name)
    return found or pytest.skip(f'{name} is not installed')


def run(*words):
    return subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False, timeout=60)


def complaints(unit: Path) -> list[str]:
    """What systemd says of this unit; of the units of this machine nothing."""
    done = run(program('systemd-analyze'), 'verify', '--man=no', unit)
    return [line for line in done.stderr.splitlines() if unit.name in line]


def environment_of_unit() -> dict[str, str]:
    lines = re.findall('^Environment=(.*)$', UNIT.read_text(encoding='utf-8'), re.MULTILINE)
    return dict(word.split('=', 1) for line in lines for word in line.split())


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


def test_the_service_has_little_to_lose():
    done = run(program('systemd-analyze'), 'security', '--offline=yes', f'--threshold={MOST_EXPOSED}', '--no-pager',
               UNIT)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize('words', [words_of_unit(), words_of_image(), compose()['command']])
def test_each_starts_the_driver_alone_and_waits_for_its_bus(words):
    driver, = described(_parser('bringup').parse_args(['bringup', *words]), '')
    assert driver.label == 'skin_driver' and driver.parameters.get('wait_at_start', True)
    assert len(driver.parameters['pads']) == len(driver.parameters['node_ids'])


@pytest.mark.parametrize('environment', [environment_of_unit(), compose()['environment']])
def test_no_shared_memory_is_used_that_others_cannot_open(environment):
    """Else topics are listed and bring nothing. With LOCALHOST rmw_fastrtps does not read the first variable."""
    assert environment['FASTDDS_BUILTIN_TRANSPORTS'] == 'UDPv4'
    assert environment['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'SUBNET'


def test_the_service_may_open_a_can_socket():
    text = UNIT.read_text(encoding='utf-8')
    families = re.search('^RestrictAddressFamilies=(.*)$', text, re.MULTILINE)[1].split()
    assert {'AF_CAN', 'AF_INET', 'AF_NETLINK'} <= set(families)
    assert 'PrivateNetwork' not in text


def test_the_container_has_the_hosts_network_and_no_rights():
    service = compose()
    assert service['network_mode'] == 'host'
    assert service['cap_drop'] == ['ALL'] and 'cap_add' not in service and 'privileged' not in service
    assert service['read_only'] is True and service['security_opt'] == ['no-new-privileges:true']
    assert re.search(r'^USER [1-9]\d*$', (CONTAINER / 'Dockerfile').read_text(encoding='utf-8'), re.MULTILINE)


def test_the_compose_file_is_one_of_the_compose_specification():
    done = run(program('check-jsonschema'), '--builtin-schema', 'vendor.compose-spec', CONTAINER / 'compose.yaml')
    assert done.returncode == 0, done.stdout


def test_hadolint_has_nothing_to_say_of_the_dockerfile():
    done = run(program('hadolint'), '--no-color', CONTAINER / 'Dockerfile')
    assert done.returncode == 0, done.stdout


def test_the_entrypoint_is_a_script_that_leaves_one_process():
    assert run('bash', '-n', CONTAINER / 'entrypoint.sh').returncode == 0
    assert (CONTAINER / 'entrypoint.sh').read_text(encoding='utf-8').splitlines()[-1].startswith('exec tactile ')
