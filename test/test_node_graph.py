"""The names, topics and parameters of a bus's nodes are defined in one place."""

import subprocess
import sys
from pathlib import Path

import pytest

from examples.demo.topics import frame_topics
from tactile_node.errors import ConfigurationError
from tactile_node.node_graph import bus_nodes

ROOT = Path(__file__).resolve().parents[1]
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


@pytest.mark.parametrize('namespace', ['my-robot', '2nd', 'a//b', 'a/', 'a b'])
def test_a_namespace_that_ros_refuses_is_refused_before_any_node_is_made(namespace):
    with pytest.raises(ConfigurationError) as refused:
        bus_nodes(GRIPPER, driver={}, namespace=namespace)
    assert refused.value.where == 'namespace' and refused.value.got == repr(namespace)


def test_pads_without_a_comma_are_refused_with_the_hint():
    with pytest.raises(ConfigurationError, match='Commas') as refused:
        bus_nodes(['left right'], driver={})
    assert refused.value.got == "'left right'"


def test_parameters_of_every_node_reach_every_node_and_the_drivers_own_win():
    nodes = bus_nodes(GRIPPER, driver={'queue_depth': 7}, every={'queue_depth': 5, 'lossless': True})
    assert all(node.parameters['lossless'] is True for node in nodes)
    assert [node.parameters['queue_depth'] for node in nodes] == [5] * 5 + [7]
    assert nodes[-1].parameters['pads'] == list(GRIPPER)


@pytest.mark.parametrize('pads', [[], ['left', 'left']])
def test_pads_without_names_of_their_own_are_refused(pads):
    with pytest.raises(ConfigurationError):
        bus_nodes(pads, driver={})


@pytest.mark.ros
@pytest.mark.parametrize(('pads', 'namespace'), [(['pad'], ''), (['left', 'right'], 'hand'),
                                                 (['a', 'b', 'c'], '/robot/hand')])
def test_the_nodes_have_the_described_names_parameters_and_topics(pads, namespace):
    rclpy = pytest.importorskip('rclpy')
    pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')
    from tactile_node.nodes.system import System
    described = bus_nodes(pads, driver={'channel': 'can7'}, every={'lossless': True}, grasp={'frame_id': 'palm'},
                          namespace=namespace)
    rclpy.init()
    system = System(described)
    try:
        for description, node in zip(described, system.nodes, strict=True):
            assert description.name == node.get_name()
            assert f'/{description.namespace.strip("/")}' == node.get_namespace()
            for name, value in description.parameters.items():
                assert node.get_parameter(name).value == value
        published = {topic: types for node in system.nodes
                     for topic, types in node.get_publisher_names_and_types_by_node(
                         node.get_name(), node.get_namespace())}
        expected = frame_topics(pads, namespace)
        # The driver publishes these topics only after it has been configured.
        by_driver = {topic for topic in expected if topic.endswith('/taxels')}
        assert {topic: published[topic] for topic in set(expected) - by_driver} == {
            topic: [kind] for topic, kind in expected.items() if topic not in by_driver}
        assert any(publisher.topic_name.endswith('skin_driver/status') for publisher in system.driver.publishers)
    finally:
        system.destroy()
        rclpy.shutdown()
