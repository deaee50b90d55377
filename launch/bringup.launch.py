"""Starts driver, processor and classifier for the pads of one CAN bus; see the arguments below."""

import os
import tempfile

from launch.actions import DeclareLaunchArgument, EmitEvent, ExecuteProcess, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit, OnProcessIO, OnShutdown
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile
from launch_ros.substitutions import ExecutableInPackage

from launch import LaunchDescription
from tactile_node.node_graph import NodeDescription, bus_nodes

PACKAGE = 'tactile_skin'
ARGUMENTS = {  # name: (default, description)
    'interface': ('', 'python-can interface: socketcan (default), slcan, pcan, kvaser, ...'),
    'channel': ('', 'channel of the interface (default can0)'),
    'bitrate': ('', 'bit rate of the bus [bit/s] (default 1000000)'),
    'pads': ('pad', 'names of the pads on this bus, comma-separated; topics are <name>/taxels, features, shape, pose'),
    'node_id': ('32', 'CANopen node-ID of each pad (of each of its nodes), comma-separated'),
    'layout': ('', 'skin layout of each pad, comma-separated, or one for all (default sim16x16.yaml)'),
    'eds': ('', 'EDS of each pad, comma-separated, or one for all; empty: named as the layout'),
    'namespace': ('', 'namespace of all nodes and topics'),
    'params_file': ('', 'ROS 2 parameter file for all nodes; arguments given here win over it'),
    'simulate': ('false', 'true: a simulated skin on a pseudo-terminal in place of the bus'),
    'replay': ('', 'recorded CAN log to play in place of the bus'),
    'replay_channel': ('', 'bus to play from a log of several buses, as the log names it; for a bag, the topic'),
    'replay_pace': ('', 'speed of the replay: 1 as recorded (default), 0 as fast as possible'),
    'record': ('', 'file to record the bus to'),
    'wait_at_start': ('', 'true (default): wait for a missing bus or device; false: exit'),
    'autostart': ('', 'true (default): configure and activate at start; false: leave both to a lifecycle manager'),
}


def generate_launch_description() -> LaunchDescription:
    declared = [DeclareLaunchArgument(name, default_value=default, description=description)
                for name, (default, description) in ARGUMENTS.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=bringup)])


def bringup(context) -> list:
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    simulate = switch('simulate', given['simulate'])
    if simulate:
        folder = tempfile.TemporaryDirectory(prefix='tactile_skin_')
        link = os.path.join(folder.name, 'skin')
        given |= {'interface': 'slcan', 'channel': link}
    every = {'lossless': True} if given['replay'] else {}
    described = bus_nodes(split(given['pads']), driver=driver_parameters(given), every=every,
                          namespace=given['namespace'])
    *others, driver = [ros_node(description, params_file(given)) for description in described]
    if not simulate:
        return [*others, driver, end_with(driver, 'the skin driver')]
    return [*others, *simulated(given, link, driver), end_with(driver, 'the skin driver'),
            RegisterEventHandler(OnShutdown(on_shutdown=lambda event, context: folder.cleanup()))]


def driver_parameters(given: dict) -> dict:
    """Only what was given: the rest is left to the parameter file and the driver's defaults."""
    readers = {'interface': str, 'channel': str, 'replay': str, 'replay_channel': str, 'record': str, 'bitrate': whole,
               'replay_pace': float}
    parameters = {name: reader(given[name]) for name, reader in readers.items() if given[name]}
    parameters |= {name: split(given[argument]) for name, argument in (('layouts', 'layout'), ('eds', 'eds'))
                   if given[argument]}
    parameters |= {name: switch(name, given[name]) for name in ('autostart', 'wait_at_start') if given[name]}
    return parameters | {'node_ids': [whole(node_id) for node_id in split(given['node_id'])]}


def ros_node(description: NodeDescription, params_file: list) -> Node:
    return Node(package=PACKAGE, executable=description.executable, name=description.name,
                namespace=description.namespace, parameters=[*params_file, dict(description.parameters)],
                output='screen')


def simulated(given: dict, link: str, driver: Node) -> list:
    """The simulated skin as its own process; the driver starts once the skin's port exists."""
    words = [word for name, option in (('node_id', '--node-id'), ('layout', '--layout'), ('eds', '--eds'))
             if given[name] for word in (option, given[name])]
    skin = ExecuteProcess(cmd=[ExecutableInPackage('tactile', PACKAGE), 'simulate', '--pty', '--link', link, *words],
                          output='screen')
    started = []

    def when_ready(event):
        if not started and b'Simulated skin' in event.text:
            started.append(True)
            return [driver]
    return [skin, RegisterEventHandler(OnProcessIO(target_action=skin, on_stdout=when_ready)),
            end_with(skin, 'the simulated skin')]


def end_with(process, name: str) -> RegisterEventHandler:
    """End the launch with ``process``; with exit code 1 where it has failed, for systemd."""
    def ended(event, context):
        if event.returncode and not context.is_shutdown:
            raise RuntimeError(f'{name} has failed, code {event.returncode}')
        return [EmitEvent(event=Shutdown(reason=f'{name} has ended'))]
    return RegisterEventHandler(OnProcessExit(target_action=process, on_exit=ended))


def params_file(given: dict) -> list:
    return [ParameterFile(given['params_file'])] if given['params_file'] else []


def switch(name: str, text: str) -> bool:
    if text.lower() not in ('true', 'false', '1', '0', 'yes', 'no'):
        raise ValueError(f'{name}:={text}: expected true or false')
    return text.lower() in ('true', '1', 'yes')


def whole(text: str) -> int:
    try:
        return int(text, 0)
    except ValueError:
        raise ValueError(f'expected a whole number, got {text!r} (bitrate, node_id)') from None


def split(text: str) -> list:
    return [part.strip() for part in text.split(',') if part.strip()]
