"""Tests that the SROS 2 policy in examples/ grants the running nodes exactly the access that they need."""

import time
from contextlib import ExitStack
from pathlib import Path
from threading import Event
from xml.etree import ElementTree

import pytest
import rclpy

from tactile_node.node_graph import bus_nodes
from tactile_node.nodes.spinner import spinning
from tactile_node.nodes.system import System
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.simulator.touches import gripper_sources
from tactile_node.skin.pads import make_pads, with_dictionaries

pytestmark = [pytest.mark.ros, pytest.mark.bus]

ROOT = Path(__file__).resolve().parents[1]
POLICY = ElementTree.parse(ROOT / 'examples/sros2_policy.xml').getroot()
PADS, LAYOUT = ['left', 'right'], 'sim16x16.yaml'
TIMEOUT = 60.0  # Timeout for discovery, long enough for a busy machine [s].
SUBSCRIBED = 'topics', 'subscribe'
#: Maps each kind of policy entry to the type of the ROS endpoint that the entry allows.
ENDPOINTS = {('topics', 'publish'): 'publisher', SUBSCRIBED: 'subscriber', ('services', 'reply'): 'service',
             ('services', 'request'): 'client'}


def graph_of(watcher, nodes) -> dict:
    """Return the topics and services of each node, keyed by (kind, attribute) and then by (namespace, node)."""
    keys = [(node.get_namespace(), node.get_name()) for node in nodes]
    return {kind: {(space, name): {topic for topic, _ in getattr(watcher, f'get_{endpoint}_names_and_types_by_node')(
        name, space)} for space, name in keys} for kind, endpoint in ENDPOINTS.items()}


@pytest.fixture(scope='module')
def graph() -> dict:
    """Return the endpoints of all nodes of a system with two active pads."""
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
        # The policy must also fit nodes in separate processes. Once active, nodes in one process pass messages directly
        # to each other and drop some subscriptions, so the subscriptions are read before the activation.
        before = settled(watcher, system.nodes)[SUBSCRIBED]
        system.autostart(Event())
        found = settled(watcher, system.nodes)
        assert all(found[SUBSCRIBED][key] <= before[key] for key in before)
        return found | {SUBSCRIBED: before}


def settled(watcher, nodes) -> dict:
    """Wait until the ROS graph has not changed for two seconds, and return the graph."""
    deadline, before, since = time.monotonic() + TIMEOUT, None, time.monotonic()
    while True:
        now = graph_of(watcher, nodes)
        if now != before:
            before, since = now, time.monotonic()
        if time.monotonic() - since > 2:
            return now
        assert time.monotonic() < deadline
        time.sleep(0.2)


#: Topics and services that ROS 2 creates for an action (design.ros2.org, "Actions"). SROS 2 grants them to the node
#: that runs the action server.
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
    for kind, endpoints in graph.items():
        assert {key: allowed(profile, *kind) for key, profile in profiles.items()} == endpoints
    assert not any(listed(profile, 'actions', 'call') for profile in profiles.values())


def test_the_policy_lets_a_planner_read_and_nothing_else():
    profile, = POLICY.find("enclaves/enclave[@path='/planner']/profiles")
    assert allowed(profile, 'topics', 'subscribe') == {'/grasp', '/skin_driver/status'}
    assert allowed(profile, 'topics', 'publish') == {'/parameter_events', '/rosout'}
    assert not allowed(profile, 'services', 'request') and not listed(profile, 'actions', 'call')
    assert all(service.startswith('/planner_client/') for service in allowed(profile, 'services', 'reply'))
