"""Starts all nodes of one CAN bus, in one process unless `processes` says otherwise: `tactile bringup` with arguments.

Arguments are checked there, not here: a wrong one is one error of that process, and the other nodes of the robot stay.
"""

import itertools
import os
import sys

import launch.logging
from launch.actions import DeclareLaunchArgument, EmitEvent, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription
from tactile_node.errors import TactileError
from tactile_node.node_graph import NodeDescription, Processes, bus_nodes, in_processes

PACKAGE = 'tactile_skin'
RESPAWN_DELAY = 2.0  # s
#: name: (default, description). Each is the option of `tactile bringup` of the same name; empty: not given.
OPTIONS = {
    'interface': ('', 'python-can interface: socketcan (default), slcan, pcan, kvaser, ...'),
    'channel': ('', 'channel of the interface (default can0)'),
    'bitrate': ('', 'bit rate of the bus [bit/s] (default 1000000)'),
    'pads': ('pad', 'names of the pads on this bus, comma-separated; topics are <name>/taxels, features, shape, pose'),
    'node_id': ('32', 'CANopen node-ID of each pad (of each of its nodes), comma-separated'),
    'layout': ('', 'skin layout of each pad, comma-separated, or one for all (default sim16x16.yaml)'),
    'eds': ('', 'EDS of each pad, comma-separated, or one for all; empty: named as the layout'),
    'frame_ids': ('', 'frame of each pad, comma-separated (default <name>_pad)'),
    'frame_prefix': ('', 'put before every frame of pads and grasp, as robot1/'),
    'grasp_frame': ('', 'frame of the grasp (default gripper)'),
    'gap_source': ('', 'where the opening of the gripper comes from: parameter (default), joint_states, tf or none'),
    'gap': ('', 'opening of the gripper [m] with gap_source parameter; not known unless given'),
    'gap_joints': ('', 'with joint_states: joints whose positions add to the opening, comma-separated'),
    'gap_frames': ('', 'with tf: frames of the left and the right finger, comma-separated'),
    'gap_scale': ('', 'opening for a metre or a radian of the joints, or a metre between the frames (default 1)'),
    'gap_offset': ('', 'opening where these are 0 [m] (default 0)'),
    'publish_pad_frames': ('', 'true: publish the frames of the pads to tf, where no URDF has them'),
    'method': ('', 'how shapes are recognised: learned (default) or volf'),
    'model': ('', 'weights or curves of the method, as `tactile teach` writes them: a file, or a name in config/'),
    'params_file': ('', 'ROS 2 parameter file for all nodes; arguments given here win over it'),
    'use_sim_time': ('', 'true: take the time from /clock'),
    'simulate': ('false', 'true: a simulated skin in place of the bus, in the process of the driver'),
    'replay': ('', 'recorded CAN log to play in place of the bus; the process ends with the log, with code 1 when '
               'frames did not come out as shapes'),
    'replay_channel': ('', 'bus to play from a log of several buses, as the log names it; for a bag, the topic'),
    'replay_pace': ('', 'speed of the replay: 1 as recorded (default), 0 as fast as possible'),
    'publish_clock': ('', 'true: the replay publishes the time of the log on /clock, for use_sim_time'),
    'record': ('', 'file to record the bus to'),
    'wait_at_start': ('', 'true (default): wait for a missing bus or device; false: exit'),
    'autostart': ('', 'true (default): configure and activate at start; false: leave both to a lifecycle manager'),
}
BY_FILE = ('wait_at_start', 'autostart')  # given also if empty: `tactile bringup` then leaves them to the file
ARGUMENTS = {  # name: (default, description, choices)
    **{name: (default, description, None) for name, (default, description) in OPTIONS.items()},
    'namespace': ('', 'namespace of all nodes and topics, below that of PushRosNamespace', None),
    'processes': ('one', 'one: all nodes in one process; driver_apart: the driver in its own; each: a process a node; '
                  'a replay is always one',
                  [each.value for each in Processes]),
    'on_exit': ('', 'when a process of these ends: keep: nothing more (default where another launch file includes '
                'this one); respawn: start it again; shutdown: end the whole launch, with code 1 where the process '
                'has failed (default where this file itself is launched)', ['', 'keep', 'respawn', 'shutdown']),
}


def generate_launch_description() -> LaunchDescription:
    declared = [DeclareLaunchArgument(name, default_value=default, description=description, choices=choices)
                for name, (default, description, choices) in ARGUMENTS.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=bringup)])


def bringup(context) -> list:
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    given['on_exit'] = given['on_exit'] or ('shutdown' if is_launched_itself(sys.argv) else 'keep')
    chosen = Processes.ONE if given['replay'] else Processes(given['processes'])
    try:
        processes = in_processes(bus_nodes(split(given['pads']), driver={}), chosen)
    except TactileError as error:
        return failed(str(error), given['on_exit'])
    nodes = [process(part, given, whole=len(processes) == 1) for part in processes]
    if given['on_exit'] != 'shutdown':
        return nodes
    return [*nodes, *(shutdown_with(node) for node in nodes)]


def is_launched_itself(words: list[str]) -> bool:
    """Whether `ros2 launch` was given this file, by its path or after its package. launch itself does not say so."""
    return 'launch' in words and (any(os.path.realpath(word) == os.path.realpath(__file__) for word in words)
                                  or (PACKAGE, os.path.basename(__file__)) in itertools.pairwise(words))


def process(nodes: tuple[NodeDescription, ...], given: dict[str, str], *, whole: bool) -> Node:
    """One process. Names and namespaces of its nodes are its own affair: it takes the namespace of the launch alone."""
    only = [] if whole else [f'--only={",".join(node.label for node in nodes)}']
    return Node(package=PACKAGE, executable='tactile', exec_name=name_of(nodes), namespace=given['namespace'] or None,
                arguments=['bringup', *options(given), *only, f'--end-with={os.getpid()}'], output='screen',
                respawn=given['on_exit'] == 'respawn', respawn_delay=RESPAWN_DELAY)


def options(given: dict[str, str]) -> list[str]:
    """Only what was given: the rest is left to the parameter file and the nodes' defaults."""
    return [f'--{name.replace("_", "-")}={given[name]}' for name in OPTIONS if given[name] or name in BY_FILE]


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


def failed(error: str, on_exit: str) -> list:
    if on_exit == 'shutdown':
        raise RuntimeError(error)
    launch.logging.get_logger(PACKAGE).error(error)
    return []


def split(text: str) -> list[str]:
    return [part.strip() for part in text.split(',') if part.strip()]
