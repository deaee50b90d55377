"""`tactile bringup`: driver, processors and classifiers of one bus as ROS 2 nodes in one process."""

import argparse
import threading
from contextlib import ExitStack

from tactile_node.canbus.pads import make_pad
from tactile_node.interruption import interruption
from tactile_node.cli.replay import summary
from tactile_node.errors import ConfigurationError
from tactile_node.simulator.skin_simulator import SkinSimulator
from tactile_node.simulator.touches import touch_program
from tactile_node.synthetic.world import CLASSES

SIMULATED_CHANNEL = 'tactile_bringup'
DRAIN_PATIENCE = 5.0  # how long no shape may come before the rest of a log is given up [s]


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    parser = subparsers.add_parser('bringup', help='run all ROS 2 nodes of one bus in this process',
                                   description=__doc__)
    parser.add_argument('--interface', help='python-can interface (default: socketcan)')
    parser.add_argument('--channel', help='channel of the interface (default: can0)')
    parser.add_argument('--bitrate', type=int, help='bit rate [bit/s] (default: 1000000)')
    parser.add_argument('--pads', default='pad', help='names of the pads, comma-separated (default: %(default)s)')
    parser.add_argument('--node-id', default='32', help='node-ID of each pad, comma-separated (default: %(default)s)')
    parser.add_argument('--layout', default='sim16x16.yaml',
                        help='skin layout of each pad, comma-separated, or one for all (default: %(default)s)')
    parser.add_argument('--eds', default='', help='EDS of each pad, or one for all (default: named as the layout)')
    parser.add_argument('--namespace', default='', help='namespace of all nodes and topics')
    parser.add_argument('--params-file', help='ROS 2 parameter file; the options here win over it')
    parser.add_argument('--record', help='file to record the bus to')
    source = parser.add_mutually_exclusive_group()
    source.add_argument('--simulate', action='store_true', help='a simulated skin in place of the bus')
    source.add_argument('--replay', metavar='LOG', help='play a recorded CAN log in place of the bus, then end')
    parser.add_argument('--pace', type=float, default=1.0,
                        help='speed of the replay, 1 = as recorded, 0 = as fast as possible (default: %(default)s)')
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run until Ctrl-C or the end of the log; 1 when frames of a log did not come out as shapes."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from tactile_node.nodes.run import wait
    from tactile_node.nodes.spinning import spinning
    from tactile_node.nodes.system import make_system
    from tactile_node.ros.complaints import told_as_ours
    pads, node_ids = args.pads.split(','), _numbers('--node-id', args.node_id)
    with ExitStack() as stack:
        asked = stack.enter_context(interruption())
        if args.simulate:
            _simulate(args, pads, node_ids, stack)
        stack.callback(rclpy.try_shutdown)
        with told_as_ours():
            rclpy.init(args=['--ros-args', '--params-file', args.params_file] if args.params_file else [],
                       signal_handler_options=SignalHandlerOptions.NO)
            system = make_system(pads, _driver_parameters(args, node_ids), args.namespace,
                                 {'lossless': True} if args.replay else {})
        stack.callback(system.destroy)
        spinner = stack.enter_context(spinning(system.nodes))  # autostart may wait for other nodes' callbacks
        system.driver.autostart()
        if args.replay:
            return _replay(system, spinner, asked)
        wait(spinner, asked)
        return 0


def _replay(system, spinner, asked: threading.Event) -> int:
    """Wait for the log's end and for the last of its frames to come out as a shape; tell what became of all."""
    source = system.driver.source
    while not source.finished.wait(0.1) and not asked.is_set():
        spinner.check()
    published = sum(pad.published for pad in source.statistics().pads.values())
    recognised, patience = -1, DRAIN_PATIENCE
    while patience > 0 and not asked.wait(0.05):
        before, recognised = recognised, sum(node.recognised for node in system.classifiers)
        if recognised >= published:
            break
        patience = DRAIN_PATIENCE if recognised > before else patience - 0.05
    print(f'{summary(source.statistics())}\nShapes: {recognised} of {published} taxel frames')
    return 0 if recognised == published and not asked.is_set() else 1


def _simulate(args: argparse.Namespace, pads: list[str], node_ids: list[int], stack: ExitStack) -> None:
    """Put a simulated skin on a bus of this process and point the driver at it."""
    settings = [make_pad(name, node_id, layout, eds) for name, node_id, layout, eds in zip(
        pads, node_ids, _for_each(args.layout, pads), _for_each(args.eds, pads))]
    simulator = SkinSimulator(settings, {pad.name: touch_program(pad.layout, CLASSES, seed=0) for pad in settings})
    args.interface, args.channel = 'virtual', SIMULATED_CHANNEL
    simulator.start(args.interface, args.channel)
    stack.callback(simulator.stop)


def _driver_parameters(args: argparse.Namespace, node_ids: list[int]) -> dict:
    """Only what was given: the rest is left to the parameter file and the defaults."""
    given = {'interface': args.interface, 'channel': args.channel, 'bitrate': args.bitrate, 'record': args.record,
             'replay': args.replay, 'node_ids': node_ids, 'layouts': args.layout.split(','),
             'eds': args.eds.split(',')}
    if args.replay:
        given |= {'replay_pace': args.pace, 'lossless': True}
    return {name: value for name, value in given.items() if value is not None}


def _for_each(text: str, pads: list[str]) -> list[str]:
    values = text.split(',')
    return values * len(pads) if len(values) == 1 else values


def _numbers(option: str, text: str) -> list[int]:
    try:
        return [int(part, 0) for part in text.split(',')]
    except ValueError:
        raise ConfigurationError(option, expected='whole numbers, comma-separated', got=repr(text),
                                 remedy='For example --node-id 32,64.') from None
