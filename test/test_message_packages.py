"""`make messages`: the built interfaces are those of the real packages, and a real package is found first."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from built_messages import BUILT, built, write_setup

#: Hashes of the real packages: control_msgs 5.8.0 (the definitions of its branch for Jazzy, built with the tools of our
#: environment), and TFMessage as `ros2 topic info --verbose` reports it on Jazzy.
HASHES = {
    'control_msgs/action/GripperCommand': 'e17c0e644eccf14bea84a0a93e0977182872c2eb7873ca6694900059b46dbc84',
    'control_msgs/action/ParallelGripperCommand': 'adfd3c1ebe8abc38ebcc0e454b6423d291d4010dd5697d14eca5b9be4726ae18',
    'control_msgs/msg/GripperCommand': '57eb8f326c9889ca8bb34ead82cc94cc09bf6bc5c3b6c09546dca3a00b589890',
    'tf2_msgs/msg/TFMessage': 'e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087'}
SHOW = ('from control_msgs.action import ParallelGripperCommand as Found; import sys; Found.__import_type_support__(); '
        'print(Found._TYPE_SUPPORT is not None, sys.modules["control_msgs"].__file__)')


@pytest.mark.parametrize('name', HASHES)
def test_a_built_type_has_the_hash_of_the_real_package(name):
    package, *path = name.split('/')
    share = built(package, BUILT).parents[2] / 'share' / package
    described = json.loads(share.joinpath(*path).with_suffix('.json').read_text(encoding='utf-8'))
    found = {each['type_name']: each['hash_string'] for each in described['type_hashes']}
    assert found[name] == f'RIHS01_{HASHES[name]}'


def shell(script: Path, command: str, python_path: str = '') -> str:
    environment = {**os.environ, 'PYTHONPATH': python_path, 'LD_LIBRARY_PATH': ''}
    environment.pop('_ROS_WHEELS_BOOTSTRAP_COMPLETE', None)  # the shell of a user starts without it
    done = subprocess.run(['bash', '-c', f'source {script}; exec "{sys.executable}" -c \'{command}\''], env=environment,
                          capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_shell_that_sources_the_script_has_the_messages():
    script = write_setup(['control_msgs'], BUILT)
    if not script.read_text(encoding='utf-8'):
        pytest.skip('control_msgs is installed')
    is_usable, file = shell(script, SHOW).split()
    assert is_usable == 'True' and Path(file).is_relative_to(BUILT)


def test_a_real_package_is_found_first(tmp_path):
    (tmp_path / 'control_msgs').mkdir()
    (tmp_path / 'control_msgs' / '__init__.py').touch()
    found = shell(write_setup(['control_msgs'], BUILT), 'import control_msgs; print(control_msgs.__file__)',
                  str(tmp_path))
    assert Path(found.strip()).is_relative_to(tmp_path)
