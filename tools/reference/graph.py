"""Generate the tables of topics, services and actions by querying running nodes with two simulated pads."""

import re
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from threading import Event
from typing import NamedTuple

import rclpy
from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from reference import markdown as md
from reference.interfaces import files_of, first_sentence
from tactile_node.node_graph import bus_nodes
from tactile_node.nodes.spinner import spinning
from tactile_node.nodes.system import System
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.simulator.touches import gripper_sources
from tactile_node.skin.pads import make_pads, with_dictionaries

PADS, NODE_IDS, LAYOUT = ['left', 'right'], [32, 64], 'sim16x16.yaml'
NAMESPACE = 'documented'  # No other node on this machine uses this namespace.
QUIET = 1.0     # Discovery ends when nothing has changed for this time [s].
TIMEOUT = 60.0  # Time limit for discovery [s].
EVERY_NODE = 'every node'
OF_EVERY_NODE = ('describe_parameters', 'get_parameter_types', 'get_parameters', 'get_type_description',
                 'list_parameters', 'set_parameters', 'set_parameters_atomically')
#: Descriptions of the topics that have a standard message type.
OF_STANDARD_TYPES = {
    '<pad>/image': 'The taxels as values; NaN where invalid',
    '<pad>/image_colour': 'The taxels as colours',
    '<pad>/markers': 'Taxels, outline, axes, centre of pressure and name of one contact',
    '<pad>/pose': "The contact's pose alone",
    '<pad>/wrench': 'What presses on the pad; NaN where that is not known',
    'skin_driver/transition_event': 'A change of its lifecycle state',
    '/diagnostics': 'What is received, what is lost and why'}


class Open(NamedTuple):
    """A topic, service or action of a node.

    The name omits the namespace of the bus, and contains <pad> in place of the name of the pad.
    """

    node: str
    name: str
    type: str  #: Full type name: package/kind/Name.
    quality: str = ''


class Graph(NamedTuple):
    topics: tuple[Open, ...]
    services: tuple[Open, ...]
    actions: tuple[Open, ...]


def markdown() -> str:
    graph = running_graph()
    services = [each for each in graph.services if each.name.rsplit('/', 1)[-1] not in OF_EVERY_NODE]
    parts = ['## Topics', md.table(('topic', 'type', 'from', 'QoS', 'what it is'), (
        (md.code(each.name), linked(each.type), who(each.node), each.quality,
         OF_STANDARD_TYPES.get(each.name) or about(each.type)) for each in graph.topics)),
        '## Services', md.table(('service', 'type', 'of', 'what it is'), (
            (md.code(each.name), linked(each.type), who(each.node), about(each.type)) for each in services)),
        'Every node also has these services:', '\n'.join(f'- {md.code(name)}' for name in OF_EVERY_NODE)]
    if graph.actions:
        parts += ['## Actions', md.table(('action', 'type', 'of', 'what it is'), (
            (md.code(each.name), linked(each.type), who(each.node), about(each.type)) for each in graph.actions))]
    return '\n\n'.join(parts)


def linked(kind: str) -> str:
    """Return the name of a type as Markdown. For a type of this package, link to the table of its fields."""
    package, folder, name = kind.split('/')
    # The space between package and name allows a line break in a narrow column.
    return f'[`{name}`](interfaces.md#{name.lower()})' if package == 'tactile_skin' else f'{package} {md.code(name)}'


def who(node: str) -> str:
    return node if node == EVERY_NODE else md.code(node)


def about(kind: str) -> str:
    package, folder, name = kind.split('/')
    own = [path for path in files_of(folder) if path.stem == name] if package == 'tactile_skin' else []
    return md.prose(first_sentence(own[0])) if own else ''


def running_graph() -> Graph:
    """Start the nodes of two simulated pads, return their topics, services and actions, and stop the nodes."""
    with ExitStack() as stack:
        stack.enter_context(_ros())
        pads = with_dictionaries(make_pads([LAYOUT], NODE_IDS, PADS), [''])
        skin = SkinSimulator(pads, gripper_sources(pads))
        skin.start('virtual', NAMESPACE)
        stack.callback(skin.stop)
        system = System(bus_nodes(PADS, namespace=NAMESPACE, driver={
            'interface': 'virtual', 'channel': NAMESPACE, 'node_ids': NODE_IDS, 'layouts': [LAYOUT]}))
        stack.callback(system.destroy)
        watcher = rclpy.create_node('watcher', namespace=NAMESPACE)
        stack.callback(watcher.destroy_node)
        stack.enter_context(spinning(system.nodes))
        system.autostart(Event())
        return _settled(lambda: _asked(watcher, system.nodes))


@contextmanager
def _ros() -> Iterator[None]:
    rclpy.init()
    set_logger_level(NAMESPACE, LoggingSeverity.WARN)
    try:
        yield
    finally:
        rclpy.shutdown()


def _settled(ask: Callable[[], Graph]) -> Graph:
    deadline, before, since = time.monotonic() + TIMEOUT, None, time.monotonic()
    while time.monotonic() < deadline:
        now = ask()
        if now != before:
            before, since = now, time.monotonic()
        elif time.monotonic() - since > QUIET:
            return now
        time.sleep(0.1)
    raise TimeoutError(f'expected a stable ROS graph within {TIMEOUT:g} s, but it kept changing; reduce the CPU load')


def _asked(watcher: Node, nodes: tuple[Node, ...]) -> Graph:
    topics, services, actions = set(), set(), set()
    for node in nodes:
        full = node.get_name(), node.get_namespace()
        for name, types in watcher.get_publisher_names_and_types_by_node(*full):
            topics.add(Open(full[0], name, types[0], _quality(watcher, name, full[0])))
        services |= {Open(full[0], name, types[0])
                     for name, types in watcher.get_service_names_and_types_by_node(*full)}
        actions |= {Open(full[0], name, types[0])
                    for name, types in get_action_server_names_and_types_by_node(watcher, *full)}
    return Graph(*(_generic(found) for found in (topics, services, actions)))


def _generic(found: set[Open]) -> tuple[Open, ...]:
    """Return one row for each name, without the namespace and with <pad> in place of the name of a pad.

    If several nodes provide the same name, the row names EVERY_NODE.
    """
    by_name: dict[tuple[str, str], set[Open]] = {}
    for each in found:
        name = re.sub(f'^/{NAMESPACE}/(({"|".join(PADS)})(?=/))?', lambda match: '<pad>' if match[1] else '', each.name)
        if '/_action/' not in name:
            by_name.setdefault((name, each.type), set()).add(each)
    rows = []
    for (name, kind), same in by_name.items():
        nodes = {each.node for each in same}
        rows.append(Open(nodes.pop() if len(nodes) == 1 else EVERY_NODE, name, kind, min(same).quality))
    return tuple(sorted(rows, key=lambda row: (row.name.startswith('/'), not row.name.startswith('<pad>'), row.name)))


def _quality(watcher: Node, topic: str, node: str) -> str:
    """Return the reliability of a topic, and its durability if it is transient local."""
    profiles: list[QoSProfile] = [info.qos_profile for info in watcher.get_publishers_info_by_topic(topic)
                                  if info.node_name == node]
    if not profiles:
        return ''
    kinds = {ReliabilityPolicy.RELIABLE: 'reliable', ReliabilityPolicy.BEST_EFFORT: 'best effort'}
    kept = profiles[0].durability is DurabilityPolicy.TRANSIENT_LOCAL
    return kinds.get(profiles[0].reliability, '') + (', transient local' if kept else '')
