"""`tactile bringup` runs the ROS 2 nodes of one bus, or one side of these nodes, in one process, like the launch file.
"""

import argparse
import logging
import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from itertools import pairwise
from typing import Any, NamedTuple

from tactile_node.cli.options import add_number, names, node_ids, switch
from tactile_node.errors import ConfigurationError
from tactile_node.interruption import interruption, stop_with
from tactile_node.node_graph import NodeDescription, ParameterValue, Role, Side, bus_nodes, roles_of
from tactile_node.parameter import Parameter, table
from tactile_node.ros.global_names import without_global_names
from tactile_node.ros.parameter_sections import section_warnings
from tactile_node.ros.settings import (
    ClassifierSettings,
    DriverSettings,
    GraspNodeSettings,
    ProcessorSettings,
)

logger = logging.getLogger(__name__)

SIMULATED_CHANNEL = 'tactile_bringup'
SETTINGS = {Role.DRIVER: DriverSettings, Role.PROCESSOR: ProcessorSettings, Role.CLASSIFIER: ClassifierSettings,
            Role.GRASP: GraspNodeSettings}
#: options and the node parameters that they set, by role; the first node that reads an option describes it
PARAMETERS: Mapping[Role, Mapping[str, str]] = {
    Role.DRIVER: {name: name for name in (
        'node_ids', 'layouts', 'interface', 'channel', 'bitrate', 'eds', 'record', 'replay', 'replay_channel',
        'replay_pace', 'publish_clock', 'frame_ids', 'frame_prefix', 'autostart', 'wait_at_start')},
    Role.PROCESSOR: {},
    Role.CLASSIFIER: {'method': 'method', 'model': 'model'},
    Role.GRASP: {'grasp_frame': 'frame_id', 'frame_ids': 'pad_frames', **{name: name for name in (
        'frame_prefix', 'gap', 'gap_source', 'gap_joints', 'gap_frames', 'gap_scale', 'gap_offset',
        'publish_pad_frames')}}}

#: alternative spellings of options and launch arguments
OTHER_SPELLINGS = {'node_ids': 'node_id', 'layouts': 'layout'}


class Option(NamedTuple):
    """An option. If an option is not given, its value is None, and the parameter file or the default applies."""

    description: str
    read: Callable[[str], object] = str
    choices: tuple[str, ...] | None = None


def _parameter_option(row: Parameter) -> Option:
    """Return the option that sets the node parameter in a ``row`` of the parameter table.

    >>> _parameter_option(next(row for row in table(GraspNodeSettings) if row.name == 'gap_offset')).description
    'opening when the reading is 0 [m] (gap_source joint_states, tf) (default: 0)'
    """
    default = row.default if isinstance(row.default, tuple) else (row.default,)
    kind = type(default[0])
    readers: dict[type, Callable[[str], object]] = {bool: switch, int: node_ids, str: names}
    written = ','.join(str(each).lower() if kind is bool else f'{each:.9g}' if kind is float else str(each)
                       for each in default).strip(',')
    return Option(row.properties.description + (f' (default: {written})' if written else ''),
                  readers[kind] if isinstance(row.default, tuple) or kind is bool else kind)


def _rows() -> dict[str, Parameter]:
    """Return the table rows of the node parameters, by the name of the option that sets the parameter."""
    found = {'pads': next(row for row in table(DriverSettings) if row.name == 'pads')}
    for role, options in PARAMETERS.items():
        rows = {row.name: row for row in table(SETTINGS[role])}
        found |= {option: rows[name] for option, name in options.items() if option not in found}
    return found


ROWS = _rows()
OPTIONS = {
    **{name: _parameter_option(row) for name, row in ROWS.items()},
    'simulate': Option('true: use a simulated skin instead of a bus; it runs in the process of the driver', switch),
    'side': Option('run only the nodes of one side. bus: the driver, on the host with the CAN adapter; perception: the '
                   'nodes that turn taxels into shapes and grasps, on any host (default: all nodes)',
                   choices=tuple(side.value for side in Side)),
    'use_sim_time': Option('true: take the time from /clock', switch),
    'params_file': Option('ROS 2 parameter file for all nodes; an option or argument overrides its value in the file. '
                          'As an option, it may be repeated, and a later file overrides an earlier one')}
#: arguments of the launch file
ARGUMENTS = {
    **OPTIONS, 'gripper_action': Option("name of the gripper's own action, such as gripper_controller/gripper_cmd; "
                                        'a second process then runs touch_gripper in front of it (default: none)'),
    'namespace': Option('namespace of all nodes and topics, below that of PushRosNamespace'),
    'on_exit': Option('what the launch does when the process ends. keep (default): nothing; respawn: start the process '
                      'again; shutdown: end the whole launch, with exit code 1 if the process failed',
                      choices=('keep', 'respawn', 'shutdown'))}


def describe_nodes(args: argparse.Namespace, namespace: str) -> tuple[NodeDescription, ...]:
    """Return the nodes of this process, with the parameters from the options.

    Parameters
    ----------
    args
        Options of the command.
    namespace
        ROS namespace of the nodes.

    Raises
    ------
    ConfigurationError
        Raised if an option belongs to a node that this process does not run.
    """
    if args.replay and args.side:
        raise ConfigurationError('--replay', expected='all nodes of the bus in one process',
                                 got=f'--side {args.side}', remedy='Leave --side out.')
    if args.side:
        _check_side(args)
    given = {role: _parameters(args, options) for role, options in PARAMETERS.items()}
    every = _parameters(args, {'use_sim_time': 'use_sim_time'}) | ({'lossless': True} if args.replay else {})
    nodes = bus_nodes(pad_names_of(args), driver=given[Role.DRIVER] | _source_parameters(args), every=every,
                      classifier=given[Role.CLASSIFIER], grasp=given[Role.GRASP], namespace=namespace)
    return tuple(node for node in nodes if node.role in roles_of(Side(args.side))) if args.side else nodes


def pad_names_of(args: argparse.Namespace) -> list[str]:
    return list(DriverSettings.pads) if args.pads is None else args.pads


def _check_side(args: argparse.Namespace) -> None:
    """Raise ConfigurationError for an option that no node on this side reads."""
    read = {option for role in roles_of(Side(args.side)) for option in PARAMETERS[role]} | {'pads'}
    if Side(args.side) is Side.BUS:
        read.add('simulate')
    for option in sorted({*ROWS, 'simulate'} - read):
        if getattr(args, option) is not None:
            raise ConfigurationError(f'--{option.replace("_", "-")}', expected='an option of a node on this side',
                                     got=f'--side {args.side}', remedy='Give this option on the other host.')


def _source_parameters(args: argparse.Namespace) -> dict[str, ParameterValue]:
    """Return the driver parameters that replace the bus with a simulated skin or a log."""
    if args.simulate:
        return {'interface': 'virtual', 'channel': SIMULATED_CHANNEL}
    # a replay starts even if autostart is false in the parameter file
    return {'autostart': True} if args.replay else {}


def _parameters(args: argparse.Namespace, options: Mapping[str, str]) -> dict[str, ParameterValue]:
    """Return the options that the user gave. The parameter file and the defaults set all other parameters."""
    return {parameter: value for option, parameter in options.items() if (value := getattr(args, option)) is not None}


def add_options(parser: argparse.ArgumentParser) -> None:
    source = parser.add_mutually_exclusive_group()
    for name, option in OPTIONS.items():
        other = 'pace' if name == 'replay_pace' else OTHER_SPELLINGS.get(name)
        words = [f'--{spelling.replace("_", "-")}' for spelling in (name, other) if spelling]
        more: dict[str, Any] = {'choices': option.choices, 'metavar': None if option.choices else 'VALUE'}
        if option.read is switch:
            more = {'metavar': 'BOOL', **({'nargs': '?', 'const': True} if name == 'simulate' else {})}
        elif option.read in (names, node_ids):
            more = {'metavar': 'VALUE,...', 'action': 'extend'}
        elif name == 'params_file':
            more |= {'action': 'append', 'default': []}
        (source if name in ('simulate', 'replay') else parser).add_argument(
            *words, type=option.read, help=option.description.replace('%', '%%'), **more)
    parser.add_argument('--namespace', default='', help='namespace of all nodes and topics')
    add_number(parser, '--end-with', int, limits={'least': 1}, metavar='PID',
               help='end when the process with this ID ends')
    parser.add_argument('--ros-args', nargs=argparse.REMAINDER, default=[], help='ROS arguments for all nodes, '
                        'for example `-p sync_period:=0.05` for a parameter that has no option')


def run(args: argparse.Namespace) -> int:
    """Run until Ctrl-C or the end of the log. Return the exit code of `nodes.replay.play` for a log, else 0."""
    with ExitStack() as stack:
        stop_requested = stack.enter_context(interruption())
        if args.end_with:
            stop_with(args.end_with, stop_requested)
        given = without_global_names(args.ros_args)
        nodes = describe_nodes(args, given.namespace or args.namespace)
        ros_arguments = [*given.arguments, *_params_files(args)]
        for option, path in pairwise(ros_arguments):
            if option == '--params-file':
                for warning in section_warnings(path):
                    logger.warning(warning)
        if args.simulate and any(node.role is Role.DRIVER for node in nodes):
            _simulate(args, stack)
        from tactile_node.nodes.replay import play  # a late import, because `tactile --help` must work without ROS
        from tactile_node.nodes.run import running, wait
        system, spinner = stack.enter_context(running(nodes, ros_arguments))
        system.autostart(stop_requested)
        if args.replay:
            return play(system, spinner, stop_requested)
        wait(spinner, stop_requested)
        return 0


def _params_files(args: argparse.Namespace) -> list[str]:
    """Return the ROS arguments for the parameter files. A later file overrides an earlier one.

    A missing file is reported here, because rcl would log a second error and launch_ros would ignore the file.
    """
    for file in args.params_file:
        if not os.path.isfile(file):
            raise ConfigurationError('parameter file', expected='a ROS 2 parameter file (YAML)',
                                     got=f'{file!r}, which is not a file', remedy='Check its path.')
    return [word for file in args.params_file for word in ('--params-file', file)]


def _simulate(args: argparse.Namespace, stack: ExitStack) -> None:
    """Start a simulated skin on a virtual bus in this process. ``stack`` stops the simulated skin."""
    from tactile_node.simulator.skin_simulator import SkinSimulator
    from tactile_node.simulator.touches import gripper_sources
    from tactile_node.skin.pads import make_pads, with_dictionaries
    pads = with_dictionaries(make_pads(args.layouts or DriverSettings.layouts, args.node_ids or DriverSettings.node_ids,
                                       pad_names_of(args)), args.eds or DriverSettings.eds)
    simulator = SkinSimulator(pads, gripper_sources(pads))
    simulator.start('virtual', SIMULATED_CHANNEL)
    stack.callback(simulator.stop)
