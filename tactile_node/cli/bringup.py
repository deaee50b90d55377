"""`tactile bringup`: the ROS 2 nodes of one bus, or of one side of it, in one process; the launch file starts it."""

import argparse
import os
from contextlib import ExitStack
from typing import Any

from tactile_node.cli.bringup_nodes import OPTIONS, SIMULATED_CHANNEL, described, pads_of
from tactile_node.cli.options import eds_of, layouts_of, names, node_ids, node_ids_of, process_id, switch
from tactile_node.errors import ConfigurationError
from tactile_node.interruption import interruption, stop_with
from tactile_node.node_graph import Role
from tactile_node.ros.global_names import without_global_names


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('bringup', help='run all ROS 2 nodes of one bus in this process',
                                   description=__doc__)
    source = parser.add_mutually_exclusive_group()
    for name, option in OPTIONS.items():
        words = [f'--{name.replace("_", "-")}', *(['--pace'] if name == 'replay_pace' else [])]
        more: dict[str, Any] = {'choices': option.choices, 'metavar': None if option.choices else 'VALUE'}
        if option.read is switch:
            more = {'metavar': 'BOOL', **({'nargs': '?', 'const': True} if name == 'simulate' else {})}
        elif option.read in (names, node_ids):
            more = {'metavar': 'VALUE,...', 'action': 'extend'}
        (source if name in ('simulate', 'replay') else parser).add_argument(
            *words, type=option.read, help=option.description.replace('%', '%%'), **more)
    parser.add_argument('--namespace', default='', help='namespace of all nodes and topics')
    parser.add_argument('--end-with', type=process_id, metavar='PID', help='end when this process ends')
    parser.add_argument('--ros-args', nargs=argparse.REMAINDER, default=[], help='ROS arguments, for all nodes')
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run until Ctrl-C or the end of the log; 1 when frames of a log did not come out as shapes."""
    with ExitStack() as stack:
        stop_requested = stack.enter_context(interruption())
        if args.end_with:
            stop_with(args.end_with, stop_requested)
        given = without_global_names(args.ros_args)
        nodes = described(args, given.namespace or args.namespace)
        ros_arguments = [*given.arguments, *_params_file(args)]
        if args.simulate and any(node.role is Role.DRIVER for node in nodes):
            _simulate(args, stack)
        from tactile_node.nodes.bringup import play, running  # only here: `tactile --help` needs no ROS
        from tactile_node.nodes.run import wait
        system, spinner = stack.enter_context(running(nodes, ros_arguments))
        system.autostart(stop_requested)
        if args.replay:
            return play(system, spinner, stop_requested)
        wait(spinner, stop_requested)
        return 0


def _params_file(args: argparse.Namespace) -> list[str]:
    """Checked here: rcl would log another error beside ours, launch_ros leaves a missing file out."""
    if not args.params_file:
        return []
    if not os.path.isfile(args.params_file):
        raise ConfigurationError('parameter file', expected='a ROS 2 parameter file (YAML)',
                                 got=f'{args.params_file!r}, which is no file', remedy='Check its path.')
    return ['--params-file', args.params_file]


def _simulate(args: argparse.Namespace, stack: ExitStack) -> None:
    """Put a simulated skin on a bus of this process."""
    from tactile_node.simulator.gripper import gripper_sources
    from tactile_node.simulator.skin_simulator import SkinSimulator
    from tactile_node.skin.pads import make_pads, with_dictionaries
    pads = with_dictionaries(make_pads(layouts_of(args), node_ids_of(args), pads_of(args)), eds_of(args))
    simulator = SkinSimulator(pads, gripper_sources(pads))
    simulator.start('virtual', SIMULATED_CHANNEL)
    stack.callback(simulator.stop)
