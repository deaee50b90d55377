"""Starts the nodes of one CAN bus in one process, or those of one side of it: `tactile bringup` with arguments.

Arguments are checked there, not here: a wrong one is one error of that process, and the other nodes of the robot stay.
"""

import os

from launch.action import Action
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch.launch_context import LaunchContext
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription
from tactile_node.cli.bringup import ARGUMENTS, OPTIONS

RESPAWN_DELAY = 2.0  # s


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value='', description=each.description,
                                choices=['', *each.choices] if each.choices else None)
          for name, each in ARGUMENTS.items()), OpaqueFunction(function=start)])


def start(context: LaunchContext) -> list[Action]:
    """Start the process. It names its nodes and puts them in namespaces: it takes that of the launch alone.

    Only what was given becomes an option: the rest is left to the parameter file and the nodes' defaults.
    """
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    options = [f'--{name.replace("_", "-")}={given[name]}' for name in OPTIONS if given[name]]
    return [Node(package='tactile_skin', executable='tactile', exec_name='tactile',
                 namespace=given['namespace'] or None, output='screen',
                 arguments=['bringup', *options, f'--end-with={os.getpid()}'],
                 respawn=given['on_exit'] == 'respawn', respawn_delay=RESPAWN_DELAY,
                 on_exit=end_launch if given['on_exit'] == 'shutdown' else None)]


def end_launch(event: ProcessExited, context: LaunchContext) -> list[Action]:
    """End the launch with its process; with exit code 1 where that has failed, for systemd."""
    if event.returncode and not context.is_shutdown:
        raise RuntimeError(f'{event.process_name} has failed, code {event.returncode}')
    return [Shutdown(reason=f'{event.process_name} has ended')]
