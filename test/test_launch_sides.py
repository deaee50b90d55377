"""The nodes of one bus run on two hosts, and each side starts its own nodes and accepts only its own arguments.

Each node must run on exactly one host. An argument that no node reads must be refused.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from launch_stand_in import nodes_of, process_of, put_stand_ins

from tactile_node.cli.bringup import describe_nodes
from tactile_node.cli.main import _parser
from tactile_node.errors import ConfigurationError
from tactile_node.node_graph import Role

FILE = Path(__file__).resolve().parents[1] / 'launch/bringup.launch.py'
PADS = {'pads': 'left, right'}
NODES = ['left/processor', 'left/classifier', 'right/processor', 'right/classifier', 'grasp', 'skin_driver']
#: Maps an argument to its value, its parameter, the value of the parameter, and the nodes that read the parameter.
PERCEIVED = {
    'frame_ids': ('a,b', 'pad_frames', ['a', 'b'], {'grasp'}), 'frame_prefix': ('r/', 'frame_prefix', 'r/', {'grasp'}),
    'grasp_frame': ('palm', 'frame_id', 'palm', {'grasp'}), 'gap': ('0.04', 'gap', 0.04, {'grasp'}),
    'method': ('volf', 'method', 'volf', {'left/classifier', 'right/classifier'}),
    'model': ('a.npz', 'model', 'a.npz', {'left/classifier', 'right/classifier'}),
    'use_sim_time': ('true', 'use_sim_time', True, set(NODES) - {'skin_driver'})}


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch):
    put_stand_ins(monkeypatch)


def side(name, **given):
    return nodes_of(process_of(FILE, **PADS, side=name, **given))


def command(*words):
    return describe_nodes(_parser('bringup').parse_args(['bringup', *words]), '')


def test_each_node_runs_on_one_of_the_two_sides():
    assert [node.label for node in side('perception')] == NODES[:-1]
    assert [node.label for node in side('bus', node_ids='32,64')] == NODES[-1:]


@pytest.mark.parametrize('name', PERCEIVED)
def test_an_argument_of_perception_reaches_who_reads_it(name):
    value, parameter, expected, readers = PERCEIVED[name]
    found = {node.label: node.parameters for node in side('perception', **{name: value})}
    assert {label for label, parameters in found.items() if parameters.get(parameter) == expected} == readers


def test_the_bus_side_gives_the_driver_what_bringup_would():
    given = {'node_ids': '32,64', 'channel': 'can1', 'layouts': 'sim8x8_16bit.yaml', 'frame_ids': 'a,b',
             'record': 'bus.log', 'autostart': 'false'}
    driver, = side('bus', **given)
    *_, expected = nodes_of(process_of(FILE, **PADS, **given))
    assert driver == expected and driver.role is Role.DRIVER


@pytest.mark.parametrize(('words', 'option'), [
    (['--side', 'perception', '--channel', 'can0'], '--channel'), (['--side', 'perception', '--eds', 'a'], '--eds'),
    (['--side', 'perception', '--simulate'], '--simulate'), (['--side', 'bus', '--gap', '0.1'], '--gap'),
    (['--side', 'perception', '--autostart', 'false'], '--autostart'), (['--side', 'bus', '--model', 'a'], '--model'),
    (['--side', 'bus', '--replay', 'a.log'], '--replay')])
def test_an_option_that_no_node_of_the_side_reads_is_refused(words, option):
    with pytest.raises(ConfigurationError, match=f'^{option}'):
        command(*words)


WITHOUT_CAN = """
import os, signal, sys, threading

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in ('can', 'canopen', 'serial'):
            raise ModuleNotFoundError(f'{name} is not installed on this host', name=name)

sys.meta_path.insert(0, Missing())
from tactile_node.cli.main import main
from tactile_node.nodes import run
running = run.running

def observed(nodes, arguments):
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    print(*(node.label for node in nodes), flush=True)
    return running(nodes, arguments)

run.running = observed
sys.exit(main(['bringup', '--side', 'perception', '--pads', 'left,right']))
"""


@pytest.mark.ros
def test_perception_runs_on_a_host_without_can_libraries():
    pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')
    done = subprocess.run([sys.executable, '-c', WITHOUT_CAN], capture_output=True, text=True, check=False, timeout=60)
    assert done.stdout.split() == NODES[:-1]
    assert not re.search('Error|Traceback', done.stderr), done.stderr
