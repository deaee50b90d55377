"""The nodes of one bus on two hosts: what each side starts, which arguments it takes, and what is refused.

Misled would be a robot on which a node runs on both hosts or on none, and who gives an argument that no node reads.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from launch_stand_in import actions, nodes_of, processes, put_stand_ins

from tactile_node.cli.bringup_nodes import described
from tactile_node.cli.main import _parser
from tactile_node.errors import ConfigurationError
from tactile_node.launching.arguments import arguments
from tactile_node.node_graph import Role, Side

LAUNCH = Path(__file__).resolve().parents[1] / 'launch'
BUS, PERCEPTION = LAUNCH / 'bus.launch.py', LAUNCH / 'perception.launch.py'
PADS = {'pads': 'left, right'}
NODES = ['left/processor', 'left/classifier', 'right/processor', 'right/classifier', 'grasp', 'skin_driver']
ON_BUS = {'taxels': {'skin_driver'}, 'contact': {'skin_driver', 'left/processor', 'right/processor'}}
#: argument of the launch file of perception -> value, parameter, who reads it
PERCEIVED = {
    'frame_ids': ('a,b', 'pad_frames', ['a', 'b'], {'grasp'}), 'frame_prefix': ('r/', 'frame_prefix', 'r/', {'grasp'}),
    'grasp_frame': ('palm', 'frame_id', 'palm', {'grasp'}), 'gap': ('0.04', 'gap', 0.04, {'grasp'}),
    'method': ('volf', 'method', 'volf', {'left/classifier', 'right/classifier'}),
    'model': ('a.npz', 'model', 'a.npz', {'left/classifier', 'right/classifier'}),
    'use_sim_time': ('true', 'use_sim_time', True, set(NODES) - {'skin_driver'})}


@pytest.fixture(autouse=True)
def errors(monkeypatch):
    """The errors that launch was given to log."""
    return put_stand_ins(monkeypatch)


def labels(found):
    return [node.label for process in found for node in nodes_of(process)]


def command(*words):
    return described(_parser('bringup').parse_args(['bringup', *words]), '')


@pytest.mark.parametrize('split', ['', *ON_BUS])
@pytest.mark.parametrize('spread', ['one', 'each'])
def test_each_node_runs_on_one_of_the_two_sides(split, spread):
    given = {**PADS, 'processes': spread, **({'split': split} if split else {})}
    bus, perception = labels(processes(BUS, **given, node_id='32,64')), labels(processes(PERCEPTION, **given))
    assert set(bus) == ON_BUS[split or 'taxels']
    assert sorted(bus + perception) == sorted(NODES)


@pytest.mark.parametrize(('file', 'spread', 'split', 'sizes'), [
    (BUS, 'one', 'contact', [3]), (BUS, 'driver_apart', 'contact', [2, 1]), (BUS, 'driver_apart', 'taxels', [1]),
    (BUS, 'each', 'contact', [1, 1, 1]), (PERCEPTION, 'one', 'taxels', [5]), (PERCEPTION, 'each', 'contact', [1] * 3)])
def test_the_nodes_of_a_side_are_spread_over_processes(file, spread, split, sizes):
    found = processes(file, **PADS, processes=spread, split=split)
    assert [len(nodes_of(process)) for process in found] == sizes


@pytest.mark.parametrize(('file', 'side', 'split'), [
    (file, side, split) for file, side in ((BUS, 'bus'), (PERCEPTION, 'perception')) for split in ON_BUS])
def test_the_command_runs_what_the_launch_file_of_its_side_starts(file, side, split):
    launched, = processes(file, **PADS, split=split, frame_prefix='r/')
    of_bus = ['--node-id', '32'] if side == 'bus' else []
    started = command('--pads', 'left,right', '--side', side, '--split', split, '--frame-prefix', 'r/', *of_bus)
    assert [(node.label, node.role) for node in started] == [(node.label, node.role) for node in nodes_of(launched)]
    assert {node.label: node.parameters.get('frame_prefix') for node in started} == {
        node.label: node.parameters.get('frame_prefix') for node in nodes_of(launched)}


def test_both_sides_agree_on_the_topic_between_them_where_none_is_named():
    assert arguments(Side.BUS)['split'] == arguments(Side.PERCEPTION)['split']
    assert command('--side', 'bus') == command('--side', 'bus', '--split', 'taxels')


def test_perception_takes_nothing_of_bus_or_device():
    """Who must give a layout there would have to keep the layouts of two hosts the same."""
    of_bus = {'interface', 'channel', 'bitrate', 'node_id', 'layout', 'eds', 'simulate', 'record', 'wait_at_start',
              'autostart', 'replay', 'replay_pace', 'replay_channel', 'publish_clock'}
    assert not of_bus & arguments(Side.PERCEPTION).keys() and of_bus <= arguments(None).keys()
    assert not {name for name in arguments(Side.BUS) if name.startswith(('gap', 'grasp', 'model', 'method', 'replay'))}


@pytest.mark.parametrize('name', PERCEIVED)
def test_an_argument_of_perception_reaches_who_reads_it(name):
    value, parameter, expected, readers = PERCEIVED[name]
    found = {node.label: node.parameters for node in nodes_of(*processes(PERCEPTION, **PADS, **{name: value}))}
    assert {label for label, parameters in found.items() if parameters.get(parameter) == expected} == readers


def test_the_bus_side_gives_the_driver_what_bringup_would():
    given = {**PADS, 'node_id': '32,64', 'channel': 'can1', 'layout': 'sim8x8_16bit.yaml', 'frame_ids': 'a,b',
             'record': 'bus.log', 'autostart': 'false', 'wait_at_start': ''}
    driver, = nodes_of(*processes(BUS, **given))
    *_, expected = nodes_of(*processes(LAUNCH / 'bringup.launch.py', **given))
    assert driver == expected and driver.role is Role.DRIVER


@pytest.mark.parametrize('file', [BUS, PERCEPTION])
@pytest.mark.parametrize(('word', 'ends'), [('keep', False), ('shutdown', True), (None, True)])
def test_a_side_that_is_launched_itself_ends_with_its_process(file, word, ends, monkeypatch):
    monkeypatch.setattr(sys, 'argv', ['ros2', 'launch', 'tactile_skin', file.name])
    found = actions(file, **PADS, **({'on_exit': word} if word else {}))
    assert ('RegisterEventHandler' in [type(action).__name__ for action in found]) is ends


@pytest.mark.parametrize('file', [BUS, PERCEPTION])
def test_pads_of_one_name_are_one_error_of_a_side(file, errors):
    assert actions(file, pads='left,left', on_exit='keep') == []
    assert len(errors) == 1 and 'left, left' in errors[0]


@pytest.mark.parametrize(('words', 'option'), [
    (['--side', 'perception', '--channel', 'can0'], '--channel'), (['--side', 'perception', '--eds', 'a'], '--eds'),
    (['--side', 'perception', '--simulate'], '--simulate'), (['--side', 'bus', '--gap', '0.1'], '--gap'),
    (['--side', 'perception', '--autostart', 'false'], '--autostart'), (['--side', 'bus', '--model', 'a'], '--model'),
    (['--side', 'bus', '--replay', 'a.log'], '--replay'), (['--split', 'contact'], '--split'),
    (['--only', 'skin_driver', '--split', 'contact'], '--split')])
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
from tactile_node.nodes import bringup
running = bringup.running

def observed(nodes, arguments):
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    print(*(node.label for node in nodes), flush=True)
    return running(nodes, arguments)

bringup.running = observed
sys.exit(main(['bringup', '--side', 'perception', '--pads', 'left,right']))
"""


@pytest.mark.ros
def test_perception_runs_on_a_host_without_can_libraries():
    pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')
    done = subprocess.run([sys.executable, '-c', WITHOUT_CAN], capture_output=True, text=True, check=False, timeout=60)
    assert done.stdout.split() == NODES[:-1]
    assert not re.search('Error|Traceback', done.stderr), done.stderr
