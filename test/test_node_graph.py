"""The nodes of a bus are described once: launch file and process start the same names, topics and parameters."""

import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from tactile_node.node_graph import Role, bus_nodes, frame_topics

ROOT = Path(__file__).resolve().parents[1]
CASES = {
    'one pad': {'pads': 'pad', 'node_id': '32'},
    'gripper': {'pads': 'left, right', 'node_id': '32,0x40', 'namespace': 'hand', 'interface': 'virtual',
                'bitrate': '500000', 'autostart': 'false', 'layout': 'sim8x8_16bit.yaml'},
    'three pads': {'pads': 'a,b,c', 'node_id': '1,2,3', 'namespace': '/robot/hand'},
    'replay': {'pads': 'left,right', 'node_id': '32,64', 'replay': '/tmp/session.log', 'replay_pace': '0'}}
GRIPPER = ('left', 'right')


def test_the_description_needs_no_ros():
    code = 'import sys, tactile_node.node_graph; sys.exit("rclpy" in sys.modules)'
    assert subprocess.run([sys.executable, '-c', code], cwd=ROOT, check=False).returncode == 0


@pytest.mark.parametrize(('pads', 'roles'), [
    (('pad',), 'processor classifier driver'),
    (GRIPPER, 'processor classifier processor classifier grasp driver'),
    (('a', 'b', 'c'), 'processor classifier processor classifier processor classifier driver')])
def test_each_pad_has_its_nodes_and_two_pads_a_grasp(pads, roles):
    nodes = bus_nodes(pads, driver={})
    assert [node.role.value for node in nodes] == roles.split()
    assert len({(node.namespace, node.name) for node in nodes}) == len(nodes)


def test_parameters_of_every_node_reach_every_node_and_the_drivers_own_win():
    nodes = bus_nodes(GRIPPER, driver={'queue_depth': 7}, every={'queue_depth': 5, 'lossless': True})
    assert all(node.parameters['lossless'] is True for node in nodes)
    assert [node.parameters['queue_depth'] for node in nodes] == [5] * 5 + [7]
    assert nodes[-1].parameters['pads'] == list(GRIPPER)


class Recorded:
    """Stands for a class of `launch` or `launch_ros` (neither is on PyPI): what it is made with is kept."""

    def __init__(self, *given, **named):
        self.given, self.named = given, named


class Configuration(Recorded):
    def perform(self, context):
        return context[self.given[0]]


MODULES = {
    'launch': ['LaunchDescription'],
    'launch.actions': ['DeclareLaunchArgument', 'EmitEvent', 'ExecuteProcess', 'OpaqueFunction',
                       'RegisterEventHandler'],
    'launch.event_handlers': ['OnProcessExit', 'OnProcessIO', 'OnShutdown'], 'launch.events': ['Shutdown'],
    'launch.substitutions': ['LaunchConfiguration'], 'launch_ros': [], 'launch_ros.actions': ['Node'],
    'launch_ros.parameter_descriptions': ['ParameterFile'], 'launch_ros.substitutions': ['ExecutableInPackage']}


@pytest.fixture
def launch_file(monkeypatch):
    for name, classes in MODULES.items():
        module = ModuleType(name)
        for each in classes:
            base = Configuration if each == 'LaunchConfiguration' else Recorded
            setattr(module, each, type(each, (base,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    spec = spec_from_file_location('bringup_launch', ROOT / 'launch' / 'bringup.launch.py')
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def launched(launch_file, **given):
    """The nodes that the launch file starts, as (executable, name, namespace, parameters)."""
    context = {name: default for name, (default, _) in launch_file.ARGUMENTS.items()} | given
    nodes = [action.named for action in launch_file.bringup(context) if type(action).__name__ == 'Node']
    assert all(node['package'] == 'tactile_skin' for node in nodes)
    return [SimpleNamespace(executable=node['executable'], name=node['name'], namespace=node['namespace'],
                            parameters=node['parameters'][-1]) for node in nodes]


def test_the_launch_file_declares_its_arguments(launch_file):
    declared = [action for action in launch_file.generate_launch_description().given[0]
                if type(action).__name__ == 'DeclareLaunchArgument']
    assert [action.given[0] for action in declared] == list(launch_file.ARGUMENTS)
    assert all(len(action.named['description']) > 10 for action in declared)


@pytest.mark.parametrize('given', CASES.values(), ids=CASES)
def test_launch_file_and_process_start_the_same_nodes_with_the_same_parameters_and_topics(launch_file, given):
    rclpy = pytest.importorskip('rclpy')
    pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')
    from tactile_node.nodes.system import make_system
    nodes = launched(launch_file, **given)
    driver = nodes[-1].parameters
    described = bus_nodes(driver['pads'], driver=launch_file.driver_parameters(
        {name: default for name, (default, _) in launch_file.ARGUMENTS.items()} | given),
        every={'lossless': True} if 'replay' in given else {}, namespace=given.get('namespace', ''))
    rclpy.init()
    system = make_system(described)
    try:
        assert len(system.nodes) == len(nodes)
        for launched_node, node in zip(nodes, system.nodes):
            assert launched_node.name == node.get_name()
            assert f'/{launched_node.namespace.strip("/")}' == node.get_namespace()
            for name, value in launched_node.parameters.items():
                assert node.get_parameter(name).value == value
        published = {topic: types for node in system.nodes
                     for topic, types in node.get_publisher_names_and_types_by_node(
                         node.get_name(), node.get_namespace())}
        expected = frame_topics(driver['pads'], given.get('namespace', ''))
        by_driver = {topic for topic in expected if topic.endswith('/taxels')}  # published once it is configured
        assert {topic: published[topic] for topic in set(expected) - by_driver} == {
            topic: [f'tactile_skin/msg/{message}'] for topic, message in expected.items() if topic not in by_driver}
        assert any(publisher.topic_name.endswith('skin_driver/status') for publisher in system.driver.publishers)
    finally:
        system.destroy()
        rclpy.shutdown()


def test_a_simulated_skin_gets_the_drivers_node_ids_and_starts_it(launch_file):
    context = {name: default for name, (default, _) in launch_file.ARGUMENTS.items()}
    actions = launch_file.bringup(context | {'pads': 'left,right', 'node_id': '32,64', 'simulate': 'true'})
    skin, = (action for action in actions if type(action).__name__ == 'ExecuteProcess')
    assert skin.named['cmd'][1:4] == ['simulate', '--pty', '--link']
    assert skin.named['cmd'][-2:] == ['--node-id', '32,64']
    ready, = (action.given[0] for action in actions if type(action).__name__ == 'RegisterEventHandler'
              and type(action.given[0]).__name__ == 'OnProcessIO')
    driver, = ready.named['on_stdout'](SimpleNamespace(text=b'Simulated skin, node 32, 64, at /dev/pts/1'))
    assert driver.named['executable'] == f'{Role.DRIVER.value}_node'
    assert driver.named['parameters'][-1]['interface'] == 'slcan'
    assert ready.named['on_stdout'](SimpleNamespace(text=b'Simulated skin')) is None  # once
