"""The options of `tactile bringup`, which are the arguments of the launch file, and the nodes that it runs by them.

An option that sets a parameter of a node is described by the row of the node's table. Imports no ROS, so that the
launch file and the documents can read it.
"""

import argparse
from collections.abc import Callable, Mapping
from typing import NamedTuple

from tactile_node.cli.options import names, node_ids, switch
from tactile_node.errors import ConfigurationError
from tactile_node.node_graph import NodeDescription, ParameterValue, Role, Side, bus_nodes, roles_of
from tactile_node.ros.settings import (
    ClassifierSettings,
    DriverSettings,
    GraspNodeSettings,
    Parameter,
    ProcessorSettings,
    table,
)

SIMULATED_CHANNEL = 'tactile_bringup'
SETTINGS = {Role.DRIVER: DriverSettings, Role.PROCESSOR: ProcessorSettings, Role.CLASSIFIER: ClassifierSettings,
            Role.GRASP: GraspNodeSettings}
#: option -> parameter of the nodes of a role; of several, the first describes the option
PARAMETERS: Mapping[Role, Mapping[str, str]] = {
    Role.DRIVER: {'node_id': 'node_ids', 'layout': 'layouts', **{name: name for name in (
        'interface', 'channel', 'bitrate', 'eds', 'record', 'replay', 'replay_channel', 'replay_pace', 'publish_clock',
        'frame_ids', 'frame_prefix', 'autostart', 'wait_at_start')}},
    Role.PROCESSOR: {},
    Role.CLASSIFIER: {'method': 'method', 'model': 'model'},
    Role.GRASP: {'grasp_frame': 'frame_id', 'frame_ids': 'pad_frames', **{name: name for name in (
        'frame_prefix', 'gap', 'gap_source', 'gap_joints', 'gap_frames', 'gap_scale', 'gap_offset',
        'publish_pad_frames')}}}


class Option(NamedTuple):
    """An option; None where it is not given, which leaves it to the parameter file and the nodes' defaults."""

    description: str
    read: Callable[[str], object] = str
    choices: tuple[str, ...] | None = None


def parameter_option(row: Parameter) -> Option:
    """Return the option that sets the parameter of ``row``.

    >>> parameter_option(next(row for row in table(GraspNodeSettings) if row.name == 'gap_offset')).description
    'opening at reading 0 [m] (default: 0)'
    """
    default = row.default if isinstance(row.default, tuple) else (row.default,)
    kind = type(default[0])
    readers: dict[type, Callable[[str], object]] = {bool: switch, int: node_ids, str: names}
    written = ','.join(str(each).lower() if kind is bool else f'{each:.9g}' if kind is float else str(each)
                       for each in default).strip(',')
    return Option(row.properties.description + (f' (default: {written})' if written else ''),
                  readers[kind] if isinstance(row.default, tuple) or kind is bool else kind)


def _rows() -> dict[str, Parameter]:
    """Return the row that describes each option which sets a parameter."""
    found = {'pads': next(row for row in table(DriverSettings) if row.name == 'pads')}
    for role, options in PARAMETERS.items():
        rows = {row.name: row for row in table(SETTINGS[role])}
        found |= {option: rows[name] for option, name in options.items() if option not in found}
    return found


ROWS = _rows()
OPTIONS = {
    **{name: parameter_option(row) for name, row in ROWS.items()},
    'simulate': Option('true: a simulated skin in place of the bus, in the process of the driver', switch),
    'side': Option('only the nodes of this side: bus: the driver, on the host with the CAN adapter; perception: those '
                   'that make shapes and grasps of taxels, on any host (default: all nodes)',
                   choices=tuple(side.value for side in Side)),
    'use_sim_time': Option('true: take the time from /clock', switch),
    'params_file': Option('ROS 2 parameter file for all nodes; what is given beside it wins over it')}
#: of the launch file
ARGUMENTS = {
    **OPTIONS, 'namespace': Option('namespace of all nodes and topics, below that of PushRosNamespace'),
    'on_exit': Option('when the process ends: keep (default): nothing more; respawn: start it again; shutdown: end the '
                      'whole launch, with code 1 where the process has failed',
                      choices=('keep', 'respawn', 'shutdown'))}


def described(args: argparse.Namespace, namespace: str) -> tuple[NodeDescription, ...]:
    """The nodes of this process, with the parameters that were given. Raises ConfigurationError."""
    if args.replay and args.side:
        raise ConfigurationError('--replay', expected='all nodes of the bus in one process',
                                 got=f'--side {args.side}', remedy='Leave --side out.')
    if args.side:
        _check_side(args)
    given = {role: _parameters(args, options) for role, options in PARAMETERS.items()}
    every = _parameters(args, {'use_sim_time': 'use_sim_time'}) | ({'lossless': True} if args.replay else {})
    nodes = bus_nodes(pads_of(args), driver=given[Role.DRIVER] | _source_parameters(args), every=every,
                      classifier=given[Role.CLASSIFIER], grasp=given[Role.GRASP], namespace=namespace)
    return tuple(node for node in nodes if node.role in roles_of(Side(args.side))) if args.side else nodes


def pads_of(args: argparse.Namespace) -> list[str]:
    return list(DriverSettings.pads) if args.pads is None else args.pads


def _check_side(args: argparse.Namespace) -> None:
    """Raises ConfigurationError for an option that no node of this side reads: it belongs on the other host."""
    read = {option for role in roles_of(Side(args.side)) for option in PARAMETERS[role]} | {'pads'}
    if Side(args.side) is Side.BUS:
        read.add('simulate')
    for option in sorted({*ROWS, 'simulate'} - read):
        if getattr(args, option) is not None:
            raise ConfigurationError(f'--{option.replace("_", "-")}', expected='an option of a node of this side',
                                     got=f'--side {args.side}', remedy='Give it on the other host.')


def _source_parameters(args: argparse.Namespace) -> dict[str, ParameterValue]:
    """What takes the place of a bus."""
    if args.simulate:
        return {'interface': 'virtual', 'channel': SIMULATED_CHANNEL}
    return {'autostart': True} if args.replay else {}  # also where the parameter file says false


def _parameters(args: argparse.Namespace, options: Mapping[str, str]) -> dict[str, ParameterValue]:
    """Only what was given: the rest is left to the parameter file and the defaults."""
    return {parameter: value for option, parameter in options.items() if (value := getattr(args, option)) is not None}
