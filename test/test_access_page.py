"""docs/access.md lists what is open: it equals the graph of running nodes, their parameters and the policy."""

import re
import time
from contextlib import ExitStack
from pathlib import Path
from threading import Event
from xml.etree import ElementTree

import pytest

rclpy = pytest.importorskip('rclpy')
pytest.importorskip('tactile_skin.msg', reason='the messages are not built: run `make setup`')

from rclpy.parameter import Parameter  # noqa: E402

from tactile_node.node_graph import bus_nodes  # noqa: E402
from tactile_node.nodes.grasp_node import GraspNode  # noqa: E402
from tactile_node.nodes.spinning import spinning  # noqa: E402
from tactile_node.nodes.system import System  # noqa: E402
from tactile_node.ros.parameters import table  # noqa: E402
from tactile_node.ros.settings import (  # noqa: E402
    ClassifierSettings,
    DriverSettings,
    GraspNodeSettings,
    ProcessorSettings,
)
from tactile_node.simulator.gripper import gripper_sources  # noqa: E402
from tactile_node.simulator.skin_simulator import SkinSimulator  # noqa: E402
from tactile_node.skin.pads import make_pads, with_dictionaries  # noqa: E402

pytestmark = [pytest.mark.ros, pytest.mark.bus]

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / 'docs/access.md').read_text(encoding='utf-8')
POLICY = ElementTree.parse(ROOT / 'examples/sros2_policy.xml').getroot()
PADS, LAYOUT = ['left', 'right'], 'sim16x16.yaml'
SETTINGS = {'driver': DriverSettings, 'processor': ProcessorSettings, 'classifier': ClassifierSettings,
            'grasp': GraspNodeSettings}
TIMEOUT = 60.0  # s, for a busy machine
ROLES = {'skin_driver': 'driver'}


def rows(heading: str) -> list[list[str]]:
    """The cells of the table whose heading begins with these cells."""
    lines = PAGE[PAGE.index(f'| {heading} |'):].split('\n\n')[0].splitlines()[2:]
    return [[re.sub('^`([^`]*)`$', r'\1', cell.strip()) for cell in line.strip('|').split('|')] for line in lines]


class Graph:
    """What each running node publishes, subscribes to and serves: {(namespace, name): {full name: type}}."""

    def __init__(self, watcher, nodes):
        keys = [(node.get_namespace(), node.get_name()) for node in nodes]
        self.published = {key: _types(watcher.get_publisher_names_and_types_by_node, key) for key in keys}
        self.subscribed = {key: _types(watcher.get_subscriber_names_and_types_by_node, key) for key in keys}
        self.served = {key: _types(watcher.get_service_names_and_types_by_node, key) for key in keys}
        self.called = {key: _types(watcher.get_client_names_and_types_by_node, key) for key in keys}


def _types(query, key):
    namespace, name = key
    return {topic: types[0].rsplit('/', 1)[-1] for topic, types in query(name, namespace)}


@pytest.fixture(scope='module')
def graph() -> Graph:
    """Of all nodes of two pads, active."""
    rclpy.init()
    with ExitStack() as stack:
        stack.callback(rclpy.shutdown)
        pads = with_dictionaries(make_pads([LAYOUT], [32, 64], PADS), [''])
        skin = SkinSimulator(pads, gripper_sources(pads))
        skin.start('virtual', 'access')
        stack.callback(skin.stop)
        system = System(bus_nodes(PADS, driver={'interface': 'virtual', 'channel': 'access', 'node_ids': [32, 64],
                                                'layouts': [LAYOUT]}))
        stack.callback(system.destroy)
        watcher = rclpy.create_node('watcher')
        stack.callback(watcher.destroy_node)
        stack.enter_context(spinning(system.nodes))
        system.autostart(Event())
        return settled(watcher, system.nodes)


def settled(watcher, nodes) -> Graph:
    """The graph once it has not changed for two seconds: discovery takes its time."""
    deadline, before, since = time.monotonic() + TIMEOUT, None, time.monotonic()
    while True:
        now = Graph(watcher, nodes)
        if before is None or vars(now) != vars(before):
            before, since = now, time.monotonic()
        if time.monotonic() - since > 2:
            return now
        assert time.monotonic() < deadline
        time.sleep(0.2)


def generic(name: str) -> str:
    """A full name as the page has it: /left/taxels -> <pad>/taxels, /grasp -> grasp."""
    if name in ('/diagnostics', '/rosout', '/parameter_events'):
        return name
    return re.sub('^/(left|right)/', '<pad>/', name).removeprefix('/')


def publishers(name: str, graph: Graph) -> str:
    found = {ROLES.get(node, node) for (_, node), topics in graph.published.items() if name in topics}
    return 'every node' if len(found) > 1 else found.pop()


def test_the_page_lists_the_topics_of_the_running_nodes_and_no_other(graph):
    found = {(generic(name), kind, publishers(name, graph))
             for topics in graph.published.values() for name, kind in topics.items()}
    assert {tuple(row[:3]) for row in rows('topic | type | published by')} == found
    listed = {name for name, *_ in found}
    assert {generic(name) for topics in graph.subscribed.values() for name in topics} <= listed


def test_the_page_lists_the_services_of_the_running_nodes_and_no_other(graph):
    by_service: dict[str, set[str]] = {}
    for (namespace, name), services in graph.served.items():
        for service in services:
            assert service.startswith(f'{namespace.rstrip("/")}/{name}/')
            by_service.setdefault(service.rsplit('/', 1)[-1], set()).add(ROLES.get(name, name))
    found = {(service, 'every node' if len(nodes) > 1 else nodes.pop()) for service, nodes in by_service.items()}
    assert {tuple(row[:2]) for row in rows('service | of')} == found
    assert not any(graph.called.values())


def test_the_page_lists_every_parameter_that_takes_effect_at_once():
    live = {(role, row.name) for role, settings in SETTINGS.items() for row in table(settings) if row.properties.live}
    assert {tuple(row[:2]) for row in rows('node | parameter')} == live


def test_each_topic_that_needs_a_parameter_names_it():
    named = {parameter for row in rows('topic | type | parameter') for parameter in re.findall('`(\\w+)`', row[2])}
    known = {row.name for settings in SETTINGS.values() for row in table(settings)}
    assert {'publish_clock', 'gap_source', 'use_sim_time'} <= named <= known | {'use_sim_time'}


def test_the_opening_from_joint_states_reads_the_topic_that_the_page_names():
    rclpy.init()
    with ExitStack() as stack:
        stack.callback(rclpy.shutdown)
        grasp = GraspNode(parameter_overrides=[Parameter('gap_source', value='joint_states'),
                                               Parameter('gap_joints', value=['finger_joint'])])
        stack.callback(grasp.destroy_node)
        subscribed = {subscription.topic_name for subscription in grasp.subscriptions}
        assert subscribed - {'/left/shape', '/right/shape'} == {'/joint_states'}


#: What ROS 2 makes of an action, as SROS 2 allows it to the node that executes it (design.ros2.org, "Actions")
OF_ACTION = {('topics', 'publish'): ('feedback', 'status'),
             ('services', 'reply'): ('send_goal', 'cancel_goal', 'get_result')}


def allowed(profile, kind, attribute) -> set[str]:
    return listed(profile, kind, attribute) | {
        f'{action}/_action/{part}' for part in OF_ACTION.get((kind, attribute), ())
        for action in listed(profile, 'actions', 'execute')}


def listed(profile, kind, attribute) -> set[str]:
    return {entry.text for group in profile.iter(kind) if group.get(attribute) == 'ALLOW' for entry in group}


def test_the_policy_allows_our_nodes_what_they_need_and_no_more(graph):
    profiles = {(profile.get('ns'), profile.get('node')): profile
                for profile in POLICY.find("enclaves/enclave[@path='/tactile_skin']/profiles")}
    assert profiles.keys() == graph.published.keys()
    for key, profile in profiles.items():
        assert allowed(profile, 'topics', 'publish') == graph.published[key].keys()
        assert allowed(profile, 'topics', 'subscribe') == graph.subscribed[key].keys()
        assert allowed(profile, 'services', 'reply') == graph.served[key].keys()
        assert allowed(profile, 'services', 'request') == graph.called[key].keys()
        assert not listed(profile, 'actions', 'call')


def test_the_policy_lets_a_planner_read_and_nothing_else():
    profile, = POLICY.find("enclaves/enclave[@path='/planner']/profiles")
    assert allowed(profile, 'topics', 'subscribe') == {'/grasp', '/skin_driver/status'}
    assert allowed(profile, 'topics', 'publish') == {'/parameter_events', '/rosout'}
    assert not allowed(profile, 'services', 'request') and not listed(profile, 'actions', 'call')
    assert all(service.startswith('/planner_client/') for service in allowed(profile, 'services', 'reply'))
