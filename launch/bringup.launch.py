"""Starts driver, processor and classifier for the pads of one CAN bus; see the arguments below."""

import os
import tempfile

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, ExecuteProcess, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit, OnProcessIO
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile
from launch_ros.substitutions import ExecutableInPackage

PACKAGE = 'tactile_skin'
ARGUMENTS = {  # name: (default, description)
    'interface': ('socketcan', 'python-can interface: socketcan, slcan, pcan, kvaser, ...'),
    'channel': ('can0', 'channel of the interface'),
    'bitrate': ('1000000', 'bit rate of the bus [bit/s]'),
    'pads': ('pad', 'names of the pads on this bus, comma-separated; topics are <name>/taxels, features, shape'),
    'node_id': ('32', 'CANopen node-ID of each pad, comma-separated'),
    'layout': ('sim16x16.yaml', 'skin layout of each pad, comma-separated, or one for all'),
    'eds': ('', 'EDS of each pad, comma-separated, or one for all; empty: named as the layout'),
    'namespace': ('', 'namespace of all nodes and topics'),
    'params_file': ('', 'ROS 2 parameter file for all nodes; the arguments here win over it'),
    'simulate': ('false', 'true: a simulated skin on a pseudo-terminal in place of the bus'),
    'replay': ('', 'a recorded CAN log to play in place of the bus'),
    'autostart': ('true', 'false: leave configure and activate to a lifecycle manager'),
}


def generate_launch_description() -> LaunchDescription:
    declared = [DeclareLaunchArgument(name, default_value=default, description=description)
                for name, (default, description) in ARGUMENTS.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=bringup)])


def bringup(context) -> list:
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    names = split(given['pads'])
    simulate = given['simulate'].lower() in ('true', '1', 'yes')
    if simulate:
        link = os.path.join(tempfile.mkdtemp(prefix='tactile_skin_'), 'skin')
        given |= {'interface': 'slcan', 'channel': link}
    driver = driver_node(given, names)
    chain = [node for name in names for node in pad_nodes(given, name)]
    chain += grasp_nodes(given, names)
    return [*chain, *(simulated(given, link, driver) if simulate else [driver]), end_with(driver, 'the skin driver')]


def driver_node(given: dict, names: list) -> Node:
    parameters = {
        'interface': given['interface'], 'channel': given['channel'], 'bitrate': int(given['bitrate']),
        'pads': names, 'node_ids': [int(node_id, 0) for node_id in split(given['node_id'])],
        'layouts': split(given['layout']), 'eds': split(given['eds']) or [''], 'replay': given['replay'],
        'autostart': given['autostart'].lower() == 'true'}
    return Node(package=PACKAGE, executable='driver_node', name='skin_driver', namespace=given['namespace'],
                parameters=[*params_file(given), parameters | lossless(given)], output='screen')


def pad_nodes(given: dict, name: str) -> list:
    namespace = f'{given["namespace"]}/{name}' if given['namespace'] else name
    return [Node(package=PACKAGE, executable=f'{role}_node', name=role, namespace=namespace,
                 parameters=[*params_file(given), lossless(given)], output='screen')
            for role in ('processor', 'classifier')]


def grasp_nodes(given: dict, names: list) -> list:
    """Two pads are taken to face each other; where is for the parameter file to say."""
    if len(names) != 2:
        return []
    pads = {'left_pad': names[0], 'right_pad': names[1]}
    return [Node(package=PACKAGE, executable='grasp_node', name='grasp', namespace=given['namespace'],
                 parameters=[*params_file(given), pads], output='screen')]


def simulated(given: dict, link: str, driver: Node) -> list:
    """The simulated skin as a process of its own; the driver starts once its port is there."""
    node_ids = [word for node_id in split(given['node_id']) for word in ('--node-id', node_id)]
    skin = ExecuteProcess(
        cmd=[ExecutableInPackage('tactile', PACKAGE), 'simulate', '--pty', '--link', link,
             '--layout', split(given['layout'])[0], *node_ids], output='screen')
    started = []

    def when_ready(event):
        if not started and b'Simulated skin' in event.text:
            started.append(True)
            return [driver]
    return [skin, RegisterEventHandler(OnProcessIO(target_action=skin, on_stdout=when_ready)),
            end_with(skin, 'the simulated skin')]


def end_with(process, name: str) -> RegisterEventHandler:
    """Without it the rest has nothing to do."""
    return RegisterEventHandler(OnProcessExit(target_action=process, on_exit=[
        EmitEvent(event=Shutdown(reason=f'{name} has ended'))]))


def lossless(given: dict) -> dict:
    return {'lossless': True} if given['replay'] else {}


def params_file(given: dict) -> list:
    return [ParameterFile(given['params_file'])] if given['params_file'] else []


def split(text: str) -> list:
    return [part.strip() for part in text.split(',') if part.strip()]
