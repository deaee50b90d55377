"""What the launch files start: `tactile bringup` with the arguments that they were given.

Arguments are checked there, not here: a wrong one is one error of that process, and the other nodes of the robot stay.
"""

import itertools
import os
import sys
from collections.abc import Callable, Mapping

import launch.logging
from launch.action import Action
from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.launch_context import LaunchContext
from launch.launch_description import LaunchDescription
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from tactile_node.errors import TactileError
from tactile_node.launching.arguments import OPTIONS, arguments
from tactile_node.node_graph import NodeDescription, Processes, Side, Split, bus_nodes, in_processes, of_side

PACKAGE = 'tactile_skin'
RESPAWN_DELAY = 2.0  # s

Given = dict[str, str]  # the arguments of a launch file, by their names


def launch_description(side: Side | None, file: str, start: Callable[[Given], list[Action]]) -> LaunchDescription:
    """Declare the arguments of the launch file of ``side``, and ``start`` what they say."""
    declared = arguments(side)

    def begin(context: LaunchContext) -> list[Action]:
        given = {name: LaunchConfiguration(name).perform(context) for name in declared}
        given['on_exit'] = given['on_exit'] or ('shutdown' if is_launched_itself(file, sys.argv) else 'keep')
        try:
            return start(given)
        except TactileError as error:
            return failed(str(error), given['on_exit'])
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=each.default, description=each.description, choices=each.choices)
          for name, each in declared.items()), OpaqueFunction(function=begin)])


def is_launched_itself(file: str, words: list[str]) -> bool:
    """Whether `ros2 launch` was given ``file``, by its path or after its package. launch itself does not say so."""
    return 'launch' in words and (any(os.path.realpath(word) == os.path.realpath(file) for word in words)
                                  or (PACKAGE, os.path.basename(file)) in itertools.pairwise(words))


def nodes_of(given: Mapping[str, str]) -> tuple[NodeDescription, ...]:
    """Describe the nodes of the bus. Raises ConfigurationError for pads that share a name."""
    return bus_nodes([part.strip() for part in given['pads'].split(',') if part.strip()], driver={})


def start_side(side: Side, given: Given) -> list[Action]:
    """Start the nodes of ``side``. Raises ConfigurationError for pads that share a name."""
    return start_nodes(of_side(nodes_of(given), side, Split(given['split'])), given, whole=False)


def start_nodes(nodes: tuple[NodeDescription, ...], given: Given, *, whole: bool) -> list[Action]:
    """Start ``nodes``, in one process unless the argument `processes` says otherwise; ``whole``: all of a bus."""
    parts = in_processes(nodes, Processes(given['processes']))
    processes = [process(part, given, whole=whole and len(parts) == 1) for part in parts]
    if given['on_exit'] != 'shutdown':
        return processes
    return [*processes, *(shutdown_with(each) for each in processes)]


def process(nodes: tuple[NodeDescription, ...], given: Given, *, whole: bool) -> Node:
    """One process. Names and namespaces of its nodes are its own affair: it takes the namespace of the launch alone."""
    only = [] if whole else [f'--only={",".join(node.label for node in nodes)}']
    return Node(package=PACKAGE, executable='tactile', exec_name=name_of(nodes), namespace=given['namespace'] or None,
                arguments=['bringup', *options(given), *only, f'--end-with={os.getpid()}'], output='screen',
                respawn=given['on_exit'] == 'respawn', respawn_delay=RESPAWN_DELAY)


def options(given: Mapping[str, str]) -> list[str]:
    """Only what was given: the rest is left to the parameter file and the nodes' defaults."""
    return [f'--{name.replace("_", "-")}={given[name]}' for name in OPTIONS
            if given.get(name)]


def name_of(nodes: tuple[NodeDescription, ...]) -> str:
    """The process as the launch logs it."""
    return nodes[0].label.replace('/', '_') if len(nodes) == 1 else 'tactile'


def shutdown_with(node: Node) -> RegisterEventHandler:
    """End the launch with ``node``; with exit code 1 where it has failed, for systemd."""
    def ended(event, context):
        if event.returncode and not context.is_shutdown:
            raise RuntimeError(f'{event.process_name} has failed, code {event.returncode}')
        return [EmitEvent(event=Shutdown(reason=f'{event.process_name} has ended'))]
    return RegisterEventHandler(OnProcessExit(target_action=node, on_exit=ended))


def failed(error: str, on_exit: str) -> list[Action]:
    if on_exit == 'shutdown':
        raise RuntimeError(error)
    launch.logging.get_logger(PACKAGE).error(error)
    return []
