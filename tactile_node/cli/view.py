"""`tactile view` shows the pads in a browser or on a terminal, live from topics or a bus, or from a recording.

Without RECORDING, --interface and --channel, the command shows the topics of running ROS nodes. The command subscribes
to topics only while a viewer is connected. With --interface or --channel, the command reads a bus without ROS and
starts the pads itself, so no driver may run on that bus. RECORDING is a CAN log or a ROS 2 bag of this package's
topics, in which you can seek. The page is served to this machine only. To view the page from another machine, run `ssh
-L 8080:localhost:8080 ROBOT` there and open http://localhost:8080.
"""

import argparse
from collections.abc import Iterable
from threading import Event

from tactile_node.cli.options import (
    add_any_device_option,
    add_bus_options,
    add_model_option,
    add_number,
    add_skin_options,
    add_window_options,
    bus_settings_of,
    eds_of,
    live_pads_of,
    pad_names,
    pads_of,
    recogniser_of,
    window_of,
)
from tactile_node.errors import ConfigurationError
from tactile_node.interruption import interruption
from tactile_node.logs.topic_bag import holds_taxels
from tactile_node.viewing.source import ViewSource

DEFAULT_PORT = 8080
TOPICS = 'topics'
BUS = 'a bus'
LOG = 'a CAN log'
BAG = 'a bag of taxel arrays'
#: options that not every kind of source accepts, by kind of source
APPLIED_OPTIONS = {
    TOPICS: ('namespace',),
    BUS: ('interface', 'channel', 'bitrate', 'node_id', 'layout', 'eds', 'model'),
    LOG: ('channel', 'node_id', 'layout', 'eds', 'any_device', 'start', 'duration', 'model'),
    BAG: ('start', 'duration', 'model')}


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('recording', nargs='?', help='CAN log as for `tactile record`, or a ROS 2 bag')
    add_bus_options(parser, is_set=False)
    parser.add_argument('--pads', type=pad_names, metavar='NAME,...', help='names of the pads (default: all pads found '
                        'on the topics, or pad<node-ID> for any other source)')
    add_skin_options(parser)
    add_any_device_option(parser)
    add_window_options(parser)
    add_model_option(parser)
    parser.add_argument('--namespace', default='', help='namespace of the topics')
    parser.add_argument('--terminal', action='store_true', help='draw on the terminal instead of serving a page')
    add_number(parser, '--full-scale', limits={'above': 0, 'remedy': 'For example 100e3.'}, default=0.0,
               metavar='READING',
               help="reading that gets the brightest colour, in the pad's unit (default: the largest of the last 10 s)")
    parser.add_argument('--port', type=int, default=DEFAULT_PORT, help='TCP port of the page; 0: any free port '
                        '(default: %(default)s)')


def run(args: argparse.Namespace) -> int:
    """Show the pads until Ctrl-C, or, on a terminal, until a recording reaches its end."""
    with interruption() as stop_requested:
        source = source_of(args)
        try:
            source.check()
            if args.terminal:
                from tactile_node.viewing.terminal import show_in_terminal
                show_in_terminal(source, stop_requested, full_scale=args.full_scale)
            else:
                _serve(args, source, stop_requested)
        finally:
            source.close()
    return 0


def source_of(args: argparse.Namespace) -> ViewSource:
    """Return the source selected by the options. Raises ConfigurationError and LogError."""
    if args.recording is not None:
        return _recording_source(args)
    if args.interface is not None or args.channel is not None:
        _refuse_ignored(args, BUS)
        from tactile_node.viewing.bus_source import BusSource
        return BusSource(bus_settings_of(args), live_pads_of(args, args.pads or ()), recogniser_of(args))
    _refuse_ignored(args, TOPICS, 'Name a bus with --interface, or leave these options out. For topics, the classifier '
                    'node has the model as a parameter.')
    from tactile_node.nodes.topic_source import TopicSource  # the other sources do not need rclpy
    return TopicSource(args.pads or (), args.namespace)


def _recording_source(args: argparse.Namespace) -> ViewSource:
    from tactile_node.viewing.recording_source import RecordingSource
    is_bag = holds_taxels(args.recording)
    _refuse_ignored(args, BAG if is_bag else LOG)
    if is_bag:
        from tactile_node.viewing.recordings import BagRecording
        return RecordingSource(BagRecording(args.recording, args.pads or (), window_of(args)), recogniser_of(args))
    from tactile_node.viewing.recordings import LogRecording
    pads = pads_of(args, args.pads or ())
    return RecordingSource(LogRecording(args.recording, pads, args.channel or '', args.any_device,
                                        window_of(args), eds_of(args)),
                           recogniser_of(args))


def _refuse_ignored(args: argparse.Namespace, kind: str, remedy: str = 'Leave them out.') -> None:
    """Raise ConfigurationError if the user gave an option that a source of this ``kind`` would ignore."""
    every = dict.fromkeys(name for names in APPLIED_OPTIONS.values() for name in names)
    ignored = [name for name in every if getattr(args, name) and name not in APPLIED_OPTIONS[kind]]
    if ignored:
        raise ConfigurationError('tactile view', expected=f'only options that {kind} can use: '
                                 f'{_written(APPLIED_OPTIONS[kind])}', got=_written(ignored), remedy=remedy)


def _written(names: Iterable[str]) -> str:
    return ', '.join('--' + name.replace('_', '-') for name in names)


def _serve(args: argparse.Namespace, source: ViewSource, stop_requested: Event) -> None:
    from tactile_node.viewing.gate import LOOPBACK
    from tactile_node.viewing.server import ViewServer  # the terminal does not need viser
    server = ViewServer(source, args.port, args.full_scale)
    try:
        print(f'{source.title}: open http://{LOOPBACK}:{server.port} (Ctrl-C ends)', flush=True)
        stop_requested.wait()
    finally:
        server.close()
