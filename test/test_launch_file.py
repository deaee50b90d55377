"""The launch file starts `tactile bringup`. The tests check its arguments, and its actions when the command exits.

`launch` and `launch_ros` are not on PyPI. If a ROS installation provides them, the last tests run a real launch.
Without a ROS installation, these tests are skipped, and a stand-in for launch shows the actions of the file.
"""

import os
import signal
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pytest
from launch_stand_in import actions_of, declared, nodes_of, process_of, processes_of, put_stand_ins
from waiting import wait_until

from tactile_node.cli.bringup import ARGUMENTS, OTHER_SPELLINGS, PARAMETERS
from tactile_node.cli.main import _parser
from tactile_node.errors import ConfigurationError
from tactile_node.node_graph import Role, bus_nodes
from tactile_node.parameter import table
from tactile_node.ros.settings import ClassifierSettings, DriverSettings, GraspNodeSettings

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / 'launch' / 'bringup.launch.py'
GRIPPER = {'pads': 'left, right', 'node_ids': '32,0x40'}
NODES = DriverSettings, ClassifierSettings, GraspNodeSettings
#: Launch arguments whose parameter has another name.
RENAMED = {'grasp_frame': 'frame_id'}
#: Launch arguments that set no parameter of our nodes.
OTHERS = {'gripper_action', 'namespace', 'on_exit', 'side', 'simulate', 'use_sim_time', 'params_file'}


@pytest.fixture(autouse=True)
def stand_ins(request, monkeypatch):
    if 'bus' not in request.keywords:
        put_stand_ins(monkeypatch)


def options_of_the_command():
    return next(action for action in _parser('bringup')._actions if action.choices).choices[
        'bringup']._option_string_actions


def test_the_launch_file_declares_its_arguments():
    found, _ = declared(FILE)
    assert [action.given[0] for action in found] == [*ARGUMENTS, *OTHER_SPELLINGS.values()]
    assert all(len(action.named['description']) > 10 for action in found)


def test_every_argument_is_an_option_of_the_command_but_what_the_launch_alone_does():
    assert {f'--{name.replace("_", "-")}' for name in ARGUMENTS} - options_of_the_command().keys() == {
        '--on-exit', '--gripper-action'}


@pytest.mark.parametrize('name', sorted(ARGUMENTS.keys() - OTHERS))
def test_an_argument_has_the_description_and_the_default_of_its_parameter(name):
    row = next(row for settings in NODES for row in table(settings) if row.name == RENAMED.get(name, name))
    option = options_of_the_command()[f'--{name.replace("_", "-")}']
    argument = next(each.named for each in declared(FILE)[0] if each.given[0] == name)
    # If an argument is not given, the parameter file and the node decide its value.
    assert option.default is None and argument['default_value'] == ''
    for text in (option.help, argument['description']):
        # The description of this parameter states the meaning of an empty value.
        if text == row.properties.description:
            assert set(row.default) <= {''}
            continue
        description, _, written = text.removesuffix(')').rpartition(' (default: ')
        default = option.type(written)
        assert description == row.properties.description
        assert default == (list(row.default) if isinstance(row.default, tuple) else row.default)
        assert isinstance(default, type(row.default)) or isinstance(row.default, tuple)


def test_every_argument_that_sets_a_parameter_of_the_driver_has_its_name():
    assert all(option == parameter for option, parameter in PARAMETERS[Role.DRIVER].items())


@pytest.mark.parametrize('option', OTHER_SPELLINGS)
def test_another_spelling_means_the_same(option):
    value = {'node_ids': '32,64', 'layouts': 'a.yaml,b.yaml'}[option]
    one, other = (nodes_of(process_of(FILE, pads='left,right', **{name: value}))[-1].parameters
                  for name in (option, OTHER_SPELLINGS[option]))
    assert one == other and one[option] != getattr(DriverSettings, option)


def called(monkeypatch, *words):
    """Return the actions of the launch file when `ros2 launch` is called with the arguments ``words``."""
    monkeypatch.setattr(sys, 'argv', ['/opt/ros/jazzy/bin/ros2', 'launch', *words])
    return actions_of(FILE, dict(word.split(':=') for word in words if ':=' in word))


@pytest.mark.parametrize('file', [['tactile_skin', 'bringup.launch.py'], [str(FILE)]], ids=['package', 'path'])
@pytest.mark.parametrize(('word', 'remedy'), [('pad:=left,right', "'pads'?"), ('speed:=3', '--show-args')])
def test_an_argument_that_the_file_does_not_declare_is_refused(file, word, remedy, monkeypatch):
    with pytest.raises(ConfigurationError) as refused:
        called(monkeypatch, *file, 'node_ids:=32,64', word)
    assert refused.value.where == f'launch argument {word.split(":=")[0]!r}' and remedy in refused.value.remedy
    assert len(called(monkeypatch, *file, 'node_ids:=32,64', 'node_id:=32')) == 1


@pytest.mark.parametrize('file', [['my_robot', 'bringup.launch.py'], ['robot.launch.py']], ids=['its name', 'another'])
def test_an_including_file_gets_warnings_only_about_misspelt_arguments(file, monkeypatch):
    """Launch passes on further arguments: those of the including file, and values that launch_ros stores."""
    names = ['robot:=ur5', 'ros_namespace:=/left', 'global_params:=x']
    assert len(called(monkeypatch, *file, *names)) == 1
    warning, process = called(monkeypatch, *file, *names, 'pad:=left,right')
    assert type(warning).__name__ == 'LogInfo' and "'pad'" in warning.named['msg'] and "'pads'" in warning.named['msg']
    assert type(process).__name__ == 'Node'


def test_the_opening_of_the_gripper_is_given_to_the_grasp_alone():
    given = {'gap_source': 'joint_states', 'gap_joints': 'finger_left, finger_right', 'gap_scale': '-0.5',
             'gap_offset': '0.08', 'publish_pad_frames': 'true', 'frame_ids': 'a,b'}
    process = process_of(FILE, **GRIPPER, **given)
    grasp = {'gap_source': 'joint_states', 'gap_joints': ['finger_left', 'finger_right'], 'gap_scale': -0.5,
             'gap_offset': 0.08, 'publish_pad_frames': True, 'pad_frames': ['a', 'b']}
    found = {node.label: node.parameters for node in nodes_of(process)}
    assert {name: found['grasp'].get(name) for name in grasp} == grasp
    assert not any(grasp.keys() & parameters.keys() for label, parameters in found.items() if label != 'grasp')
    process = process_of(FILE, **GRIPPER, gap_source='tf', gap_frames='l,r')
    assert {'gap_source': 'tf', 'gap_frames': ['l', 'r']}.items() <= {
        node.label: node.parameters for node in nodes_of(process)}['grasp'].items()


def test_a_replay_gives_the_time_on_request():
    process = process_of(FILE, **GRIPPER, replay='session.log', publish_clock='true')
    driver = {node.label: node.parameters for node in nodes_of(process)}['skin_driver']
    assert driver['publish_clock'] is True and driver['replay'] == 'session.log'


def test_the_process_runs_the_nodes_of_the_bus_with_their_parameters():
    given = GRIPPER | {'interface': 'virtual', 'bitrate': '500000', 'autostart': 'false', 'gap': '0.04',
                       'layouts': 'sim8x8_16bit.yaml', 'frame_prefix': 'robot1/', 'use_sim_time': 'true'}
    found = nodes_of(process_of(FILE, **given))
    every = {'use_sim_time': True}
    driver = {'interface': 'virtual', 'bitrate': 500000, 'autostart': False, 'layouts': ['sim8x8_16bit.yaml'],
              'node_ids': [32, 64], 'frame_prefix': 'robot1/'}
    assert found == bus_nodes(['left', 'right'], driver=driver, every=every,
                                   grasp={'gap': 0.04, 'frame_prefix': 'robot1/'})


def test_the_namespace_is_that_of_the_process_below_the_pushed_one():
    process = process_of(FILE, **GRIPPER, namespace='hand')
    # launch_ros passes the namespace /robot/hand as the remapping rule __ns; see test_bringup.py.
    assert process['namespace'] == 'hand'
    assert 'name' not in process
    assert process_of(FILE, **GRIPPER)['namespace'] is None


def test_the_simulated_skin_takes_the_place_of_the_bus():
    driver = nodes_of(process_of(FILE, **GRIPPER, simulate='true'))[-1]
    assert (driver.name, driver.parameters['interface']) == ('skin_driver', 'virtual')


def test_a_replay_is_lossless():
    nodes = nodes_of(process_of(FILE, **GRIPPER, replay='/tmp/session.log'))
    assert len(nodes) == 6 and all(node.parameters['lossless'] is True for node in nodes)


def test_the_process_ends_with_the_launch():
    assert process_of(FILE, **GRIPPER)['arguments'][-1] == f'--end-with={os.getpid()}'


PARAMETER_FILE = '''/**/touch_gripper:
  ros__parameters: {gripper_action: of_the_file, widest: 0.05}
'''


@pytest.mark.ros
@pytest.mark.parametrize('namespace', ['', 'hand'])
def test_the_gripper_node_is_a_second_process_in_the_same_namespace(namespace, tmp_path):
    """Both processes use the parameter file. Launch arguments override the values in the parameter file."""
    import rclpy
    path = tmp_path / 'parameters.yaml'
    path.write_text(PARAMETER_FILE)
    bringup, gripper = processes_of(FILE, **GRIPPER, gripper_action='arm/gripper_cmd', namespace=namespace,
                                    params_file=str(path), use_sim_time='true', on_exit='shutdown')
    assert gripper['executable'] == 'gripper_node' and gripper['arguments'][0] == f'--end-with={os.getpid()}'
    assert not any('gripper' in word for word in bringup['arguments'] if str(path) not in word)
    for name in ('namespace', 'respawn', 'output'):
        assert gripper[name] == bringup[name]
    ended = gripper['on_exit'](SimpleNamespace(returncode=0, process_name='gripper_node-2'),
                               SimpleNamespace(is_shutdown=False))
    assert [type(action).__name__ for action in ended] == ['Shutdown']
    rclpy.init(args=[*gripper['arguments'], '-r', f'__ns:=/{namespace}'])  # launch_ros adds the namespace in this form.
    try:
        node = rclpy.create_node('touch_gripper', automatically_declare_parameters_from_overrides=True)
        assert {name: node.get_parameter(name).value for name in ('gripper_action', 'widest', 'use_sim_time')} == {
            'gripper_action': 'arm/gripper_cmd', 'widest': 0.05, 'use_sim_time': True}
    finally:
        rclpy.shutdown()


@pytest.mark.parametrize(('given', 'respawns', 'ends'), [
    ({}, False, False), ({'on_exit': 'keep'}, False, False), ({'on_exit': 'respawn'}, True, False),
    ({'on_exit': 'shutdown'}, False, True)])
def test_the_argument_on_exit_decides_the_reaction_to_the_end_of_the_process(given, respawns, ends):
    process = process_of(FILE, **GRIPPER, **given)
    assert process['respawn'] is respawns and (process['on_exit'] is not None) is ends


def test_shutdown_fails_with_a_failed_process_and_not_with_one_that_ended():
    ended = process_of(FILE, on_exit='shutdown')['on_exit']
    event = SimpleNamespace(returncode=2, process_name='tactile-1')
    with pytest.raises(RuntimeError, match='tactile-1 has failed, code 2'):
        ended(event, SimpleNamespace(is_shutdown=False))
    assert [type(action).__name__ for action in ended(event, SimpleNamespace(is_shutdown=True))] == ['Shutdown']
    event.returncode = 0
    assert [type(action).__name__ for action in ended(event, SimpleNamespace(is_shutdown=False))] == ['Shutdown']


# The tests below use the real launch.

needs_launch = pytest.mark.skipif(not find_spec('launch') or not find_spec('launch_ros'),
                                  reason='launch and launch_ros come with a ROS installation only')
ROBOT = """
from launch import LaunchDescription, LaunchService
from launch.actions import ExecuteProcess, GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import PushRosNamespace
import sys

def gripper(namespace):
    given = {'simulate': 'true', 'pads': 'left,right', 'node_ids': '32,64', 'namespace': 'hand'}
    given |= dict(word.split(':=') for word in sys.argv[2:])
    source = PythonLaunchDescriptionSource(sys.argv[1])
    return GroupAction([PushRosNamespace(namespace), IncludeLaunchDescription(source,
                                                                              launch_arguments=given.items())])

service = LaunchService()
service.include_launch_description(LaunchDescription([
    ExecuteProcess(cmd=['sleep', '1000'], name='robot'),
    GroupAction([PushRosNamespace('robot'), gripper('a'), gripper('b')])]))
sys.exit(service.run())
"""


@pytest.fixture
def robot(tmp_path):
    """Return a function that launches a robot with two grippers, each with two pads, with the given arguments."""
    started = []

    def launch(*words):
        with (tmp_path / 'output').open('w') as output:
            started.append(subprocess.Popen([sys.executable, '-u', '-c', ROBOT, str(FILE), *words], stdout=output,
                                            stderr=subprocess.STDOUT, start_new_session=True))
        return started[-1], tmp_path / 'output'
    yield launch
    for process in started:
        if process.poll() is None:
            process.kill()


def processes_with(word):
    """Return the processes whose command line contains ``word``."""
    found = []
    for path in Path('/proc').glob('[0-9]*/cmdline'):
        try:
            if word.encode() in path.read_bytes():
                found.append(int(path.parent.name))
        except OSError:
            pass
    return found


@needs_launch
@pytest.mark.ros
@pytest.mark.bus
@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGINT])
def test_two_grippers_below_a_pushed_namespace_run_and_leave_no_process(robot, number):
    process, output = robot()
    expected = [f'[robot.{side}.hand.skin_driver]' for side in 'ab']
    assert wait_until(lambda: all(output.read_text().count(f'{name}: node') >= 4 for name in expected))
    children = processes_with(f'--end-with={process.pid}')
    assert len(children) == 2
    process.send_signal(number)
    process.wait(30)
    assert wait_until(lambda: not processes_with(f'--end-with={process.pid}'), 20)


@needs_launch
@pytest.mark.ros
@pytest.mark.bus
@pytest.mark.parametrize('word', ['params_file:=/nowhere.yaml', *(
    pytest.param(word, marks=pytest.mark.long) for word in ('layout:=/nowhere.yaml', 'pads:=left,left'))])
def test_a_gripper_that_cannot_start_leaves_the_robot_running(robot, word):
    process, output = robot(word)
    assert wait_until(lambda: output.read_text().count('expected ') == 2)
    time.sleep(1)
    assert process.poll() is None and output.read_text().count('expected ') == 2
    process.send_signal(signal.SIGINT)
    process.wait(30)


@needs_launch
@pytest.mark.ros
@pytest.mark.bus
def test_shutdown_ends_the_robot_with_code_1(robot):
    process, _ = robot('params_file:=/nowhere.yaml', 'on_exit:=shutdown')
    assert process.wait(60) == 1
