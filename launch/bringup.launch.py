"""Starts all nodes of one CAN bus, in one process unless `processes` says otherwise: `tactile bringup` with arguments.

Where the driver has a process apart, perception.launch.py and bus.launch.py are included: they start the same nodes on
two hosts.
"""

from pathlib import Path

from launch.action import Action
from launch.actions import GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

from launch import LaunchDescription
from tactile_node.launching.arguments import arguments
from tactile_node.launching.processes import launch_description, nodes_of, start_nodes
from tactile_node.node_graph import Processes, Side, Split


def generate_launch_description() -> LaunchDescription:
    return launch_description(None, __file__, bringup)


def bringup(given: dict[str, str]) -> list[Action]:
    nodes = nodes_of(given)  # first: an error of both sides is reported once
    if given['replay'] or given['processes'] == Processes.ONE.value:
        return start_nodes(nodes, {**given, 'processes': Processes.ONE.value}, whole=True)
    spread = Processes.ONE if given['processes'] == Processes.DRIVER_APART.value else Processes.EACH
    of_sides = {**given, 'processes': spread.value, 'split': Split.TAXELS.value}
    return [included(side, of_sides) for side in (Side.PERCEPTION, Side.BUS)]  # who listens is there first


def included(side: Side, given: dict[str, str]) -> GroupAction:
    """In a group, so that the arguments of one side do not reach the other, nor what is launched after both."""
    source = PythonLaunchDescriptionSource(str(Path(__file__).with_name(f'{side.value}.launch.py')))
    return GroupAction([IncludeLaunchDescription(
        source, launch_arguments=[(name, given[name]) for name in arguments(side)])])
