"""`tactile bringup`: the ROS 2 nodes of one bus in one process; `bringup.launch.py` starts the same."""

import argparse
import os
from contextlib import ExitStack

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
    switch_or_file,
)
from tactile_node.errors import ConfigurationError
from tactile_node.interruption import interruption, stop_with
from tactile_node.node_graph import NodeDescription, ParameterValue, Role, bus_nodes, chosen
from tactile_node.ros.global_names import without_global_names
from tactile_node.shape.method_names import DEFAULT, FILES

SIMULATED_CHANNEL = 'tactile_bringup'
#: option -> parameter of the driver, of the classifiers, of the grasp, of all nodes
DRIVER = {'interface': 'interface', 'channel': 'channel', 'bitrate': 'bitrate', 'record': 'record', 'replay': 'replay',
          'replay_channel': 'replay_channel', 'publish_clock': 'publish_clock', 'pace': 'replay_pace',
          'node_id': 'node_ids', 'layout': 'layouts', 'eds': 'eds', 'frame_ids': 'frame_ids',
          'frame_prefix': 'frame_prefix', 'autostart': 'autostart', 'wait_at_start': 'wait_at_start'}
CLASSIFIER = {'method': 'method', 'model': 'model'}
GRASP = {'grasp_frame': 'frame_id', 'frame_prefix': 'frame_prefix', 'frame_ids': 'pad_frames', 'gap': 'gap',
         'gap_source': 'gap_source', 'gap_joints': 'gap_joints', 'gap_frames': 'gap_frames', 'gap_scale': 'gap_scale',
         'gap_offset': 'gap_offset', 'publish_pad_frames': 'publish_pad_frames'}
EVERY = {'use_sim_time': 'use_sim_time'}


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('bringup', help='run all ROS 2 nodes of one bus in this process',
                                   description=__doc__)
    add_bus_options(parser, is_set=False)
    parser.add_argument('--pads', type=names, default=['pad'], metavar='NAME,...',
                        help='names of the pads (default: pad); two are taken for a gripper')
    add_skin_options(parser)
    _add_frame_options(parser)
    _add_opening_options(parser)
    parser.add_argument('--namespace', default='', help='namespace of all nodes and topics')
    parser.add_argument('--params-file', help='ROS 2 parameter file; options given here win over it')
    parser.add_argument('--use-sim-time', type=switch, metavar='BOOL', help='take the time from /clock')
    parser.add_argument('--record', help='file to record the bus to; an existing one is kept, the new one numbered')
    source = parser.add_mutually_exclusive_group()
    source.add_argument('--simulate', type=switch, nargs='?', const=True, default=False, metavar='BOOL',
                        help='a simulated skin in place of the bus (--interface and --channel are ignored)')
    source.add_argument('--replay', metavar='LOG', help='play a recorded CAN log in place of the bus, then end')
    parser.add_argument('--pace', '--replay-pace', type=pace,
                        help='speed of the replay, 1 = as recorded (default), 0 = as fast as possible')
    parser.add_argument('--publish-clock', type=switch, metavar='BOOL',
                        help='the replay publishes the time of the log on /clock')
    parser.add_argument('--replay-channel', help='bus to play from a log of several; for a bag, the topic')
    _add_recognition_options(parser)
    _add_process_options(parser)
    parser.set_defaults(run=run)


def _add_frame_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--frame-ids', type=names, metavar='FRAME,...', help='frame of each pad (default: <pad>_pad)')
    parser.add_argument('--frame-prefix', metavar='PREFIX', help='put before every frame of pads and grasp, as robot1/')
    parser.add_argument('--grasp-frame', metavar='FRAME', help='frame of the grasp (default: gripper)')


def _add_opening_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--gap-source', help='where the opening of the gripper comes from: parameter (default), '
                        'joint_states, tf or none')
    parser.add_argument('--gap', type=float, metavar='METRES', help='opening of the gripper')
    parser.add_argument('--gap-joints', type=names, metavar='JOINT,...', help='joints that add to the opening')
    parser.add_argument('--gap-frames', type=names, metavar='FRAME,FRAME', help='frames of both fingers in tf')
    parser.add_argument('--gap-scale', type=float, metavar='FACTOR', help='opening for a unit of joints or distance')
    parser.add_argument('--gap-offset', type=float, metavar='METRES', help='opening where these are 0')
    parser.add_argument('--publish-pad-frames', type=switch, metavar='BOOL', help='publish the frames of the pads to '
                        'tf, where no URDF has them (default: false)')


def _add_recognition_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--method', help=f'how shapes are recognised: {", ".join(FILES)} (default: {DEFAULT})')
    parser.add_argument('--model', metavar='FILE', help='weights or curves of the method, as `tactile teach` writes '
                        "them: a file, or a name in config/ (default: the method's own)")


def _add_process_options(parser: argparse.ArgumentParser) -> None:
    by_file = 'empty: as the parameter file has it'
    parser.add_argument('--autostart', type=switch_or_file, default=True, metavar='BOOL',
                        help=f'configure and activate the driver at start (default: true; {by_file})')
    parser.add_argument('--wait-at-start', type=switch_or_file, default=False, metavar='BOOL',
                        help=f'wait for a missing bus or device (default: false, which is an error; {by_file})')
    parser.add_argument('--only', type=names, metavar='NODE,...', help='only these nodes of the bus, as '
                        'left/processor,left/classifier or skin_driver; others run in other processes')
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


def described(args: argparse.Namespace, namespace: str) -> tuple[NodeDescription, ...]:
    """The nodes of this process, with the parameters that were given. Raises ConfigurationError."""
    if args.replay and args.only:
        raise ConfigurationError('--replay', expected='all nodes of the bus in one process', got='--only',
                                 remedy='Leave out --only (in a launch: processes:=one).')
    every = _parameters(args, EVERY) | ({'lossless': True} if args.replay else {})
    nodes = bus_nodes(args.pads, driver=_driver_parameters(args), every=every,
                      classifier=_parameters(args, CLASSIFIER), grasp=_parameters(args, GRASP), namespace=namespace)
    return chosen(nodes, args.only) if args.only else nodes


def _driver_parameters(args: argparse.Namespace) -> dict[str, ParameterValue]:
    simulated = {'interface': 'virtual', 'channel': SIMULATED_CHANNEL} if args.simulate else {}
    replayed = {'autostart': True} if args.replay else {}  # also where the parameter file says false
    return _parameters(args, DRIVER) | simulated | replayed


def _parameters(args: argparse.Namespace, options: dict[str, str]) -> dict[str, ParameterValue]:
    """Only what was given: the rest is left to the parameter file and the defaults."""
    return {parameter: value for option, parameter in options.items() if (value := getattr(args, option)) is not None}


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
