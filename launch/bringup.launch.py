"""Start `tactile bringup` from launch: one process with the nodes of one CAN bus, or of one side of that bus.

If the argument `gripper_action` is given, the launch file also starts the gripper node, as a second process.

Each process checks the values of its own arguments, so an invalid value ends only that process, and the other nodes of
the robot keep running. The launch file checks only the names of the arguments, because launch silently accepts any
name.
"""

import os
import sys
from collections.abc import Collection, Mapping, Sequence
from difflib import get_close_matches

from launch.action import Action
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, Shutdown
from launch.events.process import ProcessExited
from launch.launch_context import LaunchContext
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription
from tactile_node.cli.bringup import ARGUMENTS, OPTIONS, OTHER_SPELLINGS
from tactile_node.errors import ConfigurationError

FILE = os.path.basename(__file__)
RESPAWN_DELAY = 2.0  #: delay before launch restarts a process [s]

#: lowest similarity at which a name counts as misspelt; 'ros_namespace', which launch_ros sets, reaches 0.82
SIMILAR = 0.85
DECLARED = {*ARGUMENTS, *OTHER_SPELLINGS.values()}


def generate_launch_description() -> LaunchDescription:
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value='', description=each.description,
                                choices=['', *each.choices] if each.choices else None)
          for name, each in ARGUMENTS.items()),
        *(DeclareLaunchArgument(other, default_value='', description=f'the same as {name}')
          for name, other in OTHER_SPELLINGS.items()), OpaqueFunction(function=start)])


def start(context: LaunchContext) -> list[Action]:
    """Return the processes to start.

    `tactile bringup` chooses the names and namespaces of its nodes, so launch passes only its own namespace. Only
    arguments that the user gave become options; the parameter file and the nodes' defaults set all other values.
    """
    refuse_undeclared(sys.argv)
    given = {name: LaunchConfiguration(name).perform(context) for name in DECLARED}
    options = [f'--{name.replace("_", "-")}={given[name]}' for name in (*OPTIONS, *OTHER_SPELLINGS.values())
               if given[name]]
    processes = [process('tactile', ['bringup', *options, f'--end-with={os.getpid()}'], given)]
    if given['gripper_action']:
        words = [f'--end-with={os.getpid()}', '--ros-args']
        words += ['--params-file', given['params_file']] if given['params_file'] else []
        # These arguments follow the parameter file, because rcl uses the last value of a parameter.
        for name in ('gripper_action', 'use_sim_time'):
            words += ['-p', f'{name}:={given[name]}'] if given[name] else []
        processes.append(process('gripper_node', words, given))
    return [*warnings_of_misspelt(context.launch_configurations), *processes]


def process(executable: str, arguments: Sequence[str], given: Mapping[str, str]) -> Node:
    """Return the process that runs ``executable``; ``given`` contains the launch arguments."""
    return Node(package='tactile_skin', executable=executable, exec_name=executable,
                namespace=given['namespace'] or None, output='screen', arguments=list(arguments),
                respawn=given['on_exit'] == 'respawn', respawn_delay=RESPAWN_DELAY,
                on_exit=end_launch if given['on_exit'] == 'shutdown' else None)


def refuse_undeclared(words: Sequence[str]) -> None:
    """Raise ConfigurationError if ``words``, the command line, contains an argument that `ros2 launch` would ignore."""
    paths = [word for word in words if os.path.basename(word) == FILE]
    is_this = ('tactile_skin', FILE) in zip(words, words[1:]) or any(
        os.path.exists(path) and os.path.samefile(path, __file__) for path in paths)
    unknown = sorted({word.partition(':=')[0] for word in words if ':=' in word} - DECLARED)
    if is_this and unknown:
        similar = get_close_matches(unknown[0], ARGUMENTS, 1)
        raise ConfigurationError(f'launch argument {unknown[0]!r}', expected='an argument that this file declares',
                                 got=', '.join(unknown), remedy=f'Did you mean {similar[0]!r}?' if similar
                                 else 'List the arguments with --show-args.')


def warnings_of_misspelt(names: Collection[str]) -> list[Action]:
    """Return a warning for each name that resembles one of this file's arguments.

    Other names are not reported, because launch also passes the arguments of an including file to this file.
    """
    found = {name: get_close_matches(name, ARGUMENTS, 1, SIMILAR) for name in sorted({*names} - DECLARED)}
    return [LogInfo(msg=f'[WARN] {name!r} is not an argument of {FILE}. Did you mean {similar[0]!r}?')
            for name, similar in found.items() if similar]


def end_launch(event: ProcessExited, context: LaunchContext) -> list[Action]:
    """End the launch after one of its processes has ended, and let systemd see exit code 1 if the process failed."""

    if event.returncode and not context.is_shutdown:
        raise RuntimeError(f'{event.process_name} has failed, code {event.returncode}')
    return [Shutdown(reason=f'{event.process_name} has ended')]
