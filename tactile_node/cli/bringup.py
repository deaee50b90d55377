"""`tactile bringup`: driver, processors and classifiers of one bus as ROS 2 nodes in one process."""

import argparse
import threading
from contextlib import ExitStack

from tactile_node.cli.options import add_bus_options, add_skin_options, eds_of, layouts_of, names, node_ids_of, pace
from tactile_node.interruption import interruption
from tactile_node.node_graph import bus_nodes
from tactile_node.recording.summary import summary
from tactile_node.simulator.gripper import gripper_sources
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.skin.pads import make_pads, with_dictionaries

SIMULATED_CHANNEL = 'tactile_bringup'


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('bringup', help='run all ROS 2 nodes of one bus in this process',
                                   description=__doc__)
    add_bus_options(parser, is_set=False)
    parser.add_argument('--pads', type=names, default=['pad'], metavar='NAME,...',
                        help='names of the pads (default: pad); two are taken for a gripper')
    add_skin_options(parser)
    parser.add_argument('--namespace', default='', help='namespace of all nodes and topics')
    parser.add_argument('--params-file', help='ROS 2 parameter file; options given here win over it')
    parser.add_argument('--record', help='file to record the bus to; an existing one is kept, the new one numbered')
    source = parser.add_mutually_exclusive_group()
    source.add_argument('--simulate', action='store_true',
                        help='a simulated skin in place of the bus (--interface and --channel are ignored)')
    source.add_argument('--replay', metavar='LOG', help='play a recorded CAN log in place of the bus, then end')
    parser.add_argument('--pace', type=pace, default=1.0,
                        help='speed of the replay, 1 = as recorded, 0 = as fast as possible (default: %(default)s)')
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run until Ctrl-C or the end of the log; 1 when frames of a log did not come out as shapes."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from tactile_node.nodes.run import wait
    from tactile_node.nodes.spinning import spinning
    from tactile_node.nodes.system import make_system
    from tactile_node.ros.rclpy_errors import translate_rclpy_errors
    with ExitStack() as stack:
        stop_requested = stack.enter_context(interruption())
        if args.simulate:
            _simulate(args, stack)
        stack.callback(rclpy.try_shutdown)
        with translate_rclpy_errors():
            rclpy.init(args=['--ros-args', '--params-file', args.params_file] if args.params_file else [],
                       signal_handler_options=SignalHandlerOptions.NO)
            system = make_system(bus_nodes(args.pads, driver=_driver_parameters(args), namespace=args.namespace,
                                           every={'lossless': True} if args.replay else {}))
        stack.callback(system.destroy)
        spinner = stack.enter_context(spinning(system.nodes))  # autostart may wait for other nodes' callbacks
        system.driver.autostart()
        if args.replay:
            return _replay(system, spinner, stop_requested)
        wait(spinner, stop_requested)
        return 0


def _replay(system, spinner, stop_requested: threading.Event) -> int:
    """Wait for the log's end and for the last of its frames to come out as a shape; print the outcome."""
    from tactile_node.nodes.drain import drain, published_frames
    source = system.source
    while not source.finished.wait(0.1) and not stop_requested.is_set():
        spinner.check()
    recognised, published = drain(source, lambda: system.recognised, spinner, stop_requested), published_frames(source)
    print(f'{summary(source.statistics())}\nShapes: {recognised} of {published} taxel frames')
    return 0 if recognised == published and not stop_requested.is_set() else 1


def _simulate(args: argparse.Namespace, stack: ExitStack) -> None:
    """Put a simulated skin on a bus of this process and point the driver at it."""
    pads = with_dictionaries(make_pads(layouts_of(args), node_ids_of(args), args.pads), eds_of(args))
    simulator = SkinSimulator(pads, gripper_sources(pads))
    args.interface, args.channel = 'virtual', SIMULATED_CHANNEL
    simulator.start(args.interface, args.channel)
    stack.callback(simulator.stop)


def _driver_parameters(args: argparse.Namespace) -> dict:
    """Only what was given: the rest is left to the parameter file and the defaults."""
    given = {'interface': args.interface, 'channel': args.channel, 'bitrate': args.bitrate, 'record': args.record,
             'replay': args.replay, 'node_ids': args.node_id, 'layouts': args.layout, 'eds': args.eds,
             'autostart': True}  # also where the parameter file says false: there is no lifecycle manager here
    if args.replay:
        given |= {'replay_pace': args.pace}
    return {name: value for name, value in given.items() if value is not None}
