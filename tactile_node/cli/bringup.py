"""`tactile bringup`: the ROS 2 nodes of one bus, or of one side of it, in one process; the launch file starts it."""

import argparse
import os
from contextlib import ExitStack

from tactile_node.cli.bringup_nodes import SIMULATED_CHANNEL, described
from tactile_node.cli.options import (
    add_bus_options,
    add_skin_options,
    eds_of,
    layouts_of,
    names,
    node_ids_of,
    pace,
    process_id,
    switch,
)
from tactile_node.errors import ConfigurationError
from tactile_node.interruption import interruption, stop_with
from tactile_node.launching.arguments import OPTIONS
from tactile_node.node_graph import Role, Side
from tactile_node.ros.global_names import without_global_names

#: options that are described as the arguments of the launch file are, and what reads them
LAUNCHED = {'frame_ids': names, 'frame_prefix': str, 'grasp_frame': str, 'gap_source': str, 'gap': float,
            'gap_joints': names, 'gap_frames': names, 'gap_scale': float, 'gap_offset': float,
            'publish_pad_frames': switch, 'method': str, 'model': str, 'params_file': str, 'use_sim_time': switch,
            'publish_clock': switch, 'replay_channel': str}


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('bringup', help='run all ROS 2 nodes of one bus in this process',
                                   description=__doc__)
    add_bus_options(parser, is_set=False)
    parser.add_argument('--pads', type=names, default=['pad'], metavar='NAME,...',
                        help='names of the pads (default: pad); two are taken for a gripper')
    add_skin_options(parser)
    parser.add_argument('--namespace', default='', help='namespace of all nodes and topics')
    parser.add_argument('--record', help='file to record the bus to; an existing one is kept, the new one numbered')
    source = parser.add_mutually_exclusive_group()
    source.add_argument('--simulate', type=switch, nargs='?', const=True, metavar='BOOL',
                        help='a simulated skin in place of the bus (--interface and --channel are '
                        'ignored)')
    source.add_argument('--replay', metavar='LOG', help='play a recorded CAN log in place of the bus, then end')
    parser.add_argument('--replay-pace', '--pace', type=pace,
                        help='speed of the replay, 1 = as recorded (default), 0 = as fast as possible')
    for option, kind in LAUNCHED.items():
        parser.add_argument(f'--{option.replace("_", "-")}', type=kind, help=OPTIONS[option][1])
    _add_process_options(parser)
    parser.set_defaults(run=run)


def _add_process_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--autostart', type=switch, metavar='BOOL', help=OPTIONS['autostart'][1])
    parser.add_argument('--wait-at-start', type=switch, metavar='BOOL', help=OPTIONS['wait_at_start'][1])
    parser.add_argument('--side', choices=[side.value for side in Side], help=OPTIONS['side'][1])
    parser.add_argument('--end-with', type=process_id, metavar='PID', help='end when this process ends')
    parser.add_argument('--ros-args', nargs=argparse.REMAINDER, default=[], help='ROS arguments, for all nodes')


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
    pads = with_dictionaries(make_pads(layouts_of(args), node_ids_of(args), args.pads), eds_of(args))
    simulator = SkinSimulator(pads, gripper_sources(pads))
    simulator.start('virtual', SIMULATED_CHANNEL)
    stack.callback(simulator.stop)
