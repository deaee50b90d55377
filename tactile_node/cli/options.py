"""Options shared by several sub-commands. The option types raise ConfigurationError for text that they cannot parse."""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from math import inf, nan
from typing import TYPE_CHECKING, Any

from tactile_node.bus.bus_settings import (
    DEFAULT_BITRATE,
    DEFAULT_CHANNEL,
    DEFAULT_INTERFACE,
    DEFAULT_LAYOUT,
    DEFAULT_NODE_ID,
    BusSettings,
)
from tactile_node.cia301.objects import MAX_NODE_ID
from tactile_node.errors import BusError, ConfigurationError
from tactile_node.logs.replay_times import TimeWindow
from tactile_node.shape.recognition import LEARNED

if TYPE_CHECKING:
    from tactile_node.bus.batch_reader import Batch
    from tactile_node.bus.bus_network import BusNetwork
    from tactile_node.shape.methods import VisibilityGuard
    from tactile_node.skin.pads import LivePad, PadSettings


def node_ids(text: str) -> list[int]:
    """Parse node-IDs: '32,0x40' -> [32, 64]. With ``action='extend'``, the option may be repeated."""
    return [number(part, '--node-id', int, least=1, most=MAX_NODE_ID, remedy='For example --node-id 32,64.')
            for part in text.split(',')]


def names(text: str) -> list[str]:
    """Parse names: 'left,right' -> ['left', 'right']."""
    return [part.strip() for part in text.split(',') if part.strip()]


def pad_names(text: str) -> list[str]:
    """Parse the names of pads.

    Raises ConfigurationError for a name that contains a blank, because a comma is probably missing.
    """
    if any(len(name.split()) > 1 for name in names(text)):
        raise ConfigurationError('--pads', expected='names separated by commas', got=repr(text),
                                 remedy='Give, for example, --pads left,right.')
    return names(text)


def number(text: str, option: str, kind: type = float, *, least: float = 0, above: float = -inf, most: float = inf,
           unit: str = '', remedy: str = 'Correct the number.') -> Any:
    """Parse the number given for an option.

    Parameters
    ----------
    text : str
        Text to parse. An int may also be hexadecimal, for example 0x20.
    option : str
        Name of the option to show in the error.
    kind : type
        float or int.
    least : float
        Smallest allowed number.
    above : float
        Exclusive lower bound.
    most : float
        Largest allowed number.
    unit : str
        Unit to show in the error.
    remedy : str
        Remedy to show in the error.

    Raises
    ------
    ConfigurationError
        Raised if the text is not a number of the given kind, or if the number is out of range.

    Examples
    --------
    >>> number('0.5', '--pace'), number('0x20', '--node-id', int, least=1, most=127)
    (0.5, 32)
    """
    try:
        value = int(text, 0) if kind is int else float(text)
    except ValueError:
        value = nan
    if least <= value <= most and above < value < inf:
        return value
    limits = [f'> {above:g}' if above >= least else f'>= {least:g}', *([f'up to {most:g}'] if most < inf else [])]
    raise ConfigurationError(option, expected=f'a {"whole " * (kind is int)}number {", ".join(limits)}'
                             + (f' [{unit}]' if unit else ''), got=repr(text), remedy=remedy)


def add_number(parser: argparse._ActionsContainer, option: str, kind: type = float, *, limits: Mapping[str, Any] = {},
               **properties: Any) -> None:
    """Add an option that is a number.

    Parameters
    ----------
    parser : argparse._ActionsContainer
        Parser or group to which the option is added.
    option : str
        Name of the option.
    kind : type
        float or int.
    limits : Mapping[str, Any]
        Keyword arguments of `number`, such as least and unit.
    **properties : Any
        Keyword arguments of argparse's add_argument.
    """
    parser.add_argument(option, type=partial(number, option=option, kind=kind, **limits), **properties)


def add_window_options(parser: argparse.ArgumentParser) -> None:
    """Add --start and --duration, which `window_of` reads."""
    limits = {'unit': 's', 'remedy': 'For example --start 1800 --duration 60.'}
    add_number(parser, '--start', limits=limits, default=0.0, metavar='S', help='skip the first S seconds of the '
               'recording; the skipped part of a bag (.mcap, .db3) is not even read')
    add_number(parser, '--duration', limits=limits, metavar='S', help='length of the part to read [s] (default: all)')


def window_of(args: argparse.Namespace) -> TimeWindow:
    """Return the part of a recording that --start and --duration select."""
    return TimeWindow(args.start, inf if args.duration is None else args.duration)


def switch(text: str) -> bool:
    """Parse a bool: true or false in any case, because ROS writes both upper and lower case, or 1 or 0."""
    if text.lower() not in ('true', 'false', '1', '0'):
        raise ConfigurationError('a switch', expected='true or false', got=repr(text),
                                 remedy='Write true or false.')
    return text.lower() in ('true', '1')


def bit_rate(text: str) -> int | None:
    """Parse a bit rate: '500000' -> 500000, and 'auto' -> None."""
    return None if text == 'auto' else number(text, '--bitrate', int, least=1, unit='bit/s, or auto',
                                              remedy='For example --bitrate 500000.')


def add_bus_options(parser: argparse.ArgumentParser, *, channel: str = DEFAULT_CHANNEL, is_set: bool = True,
                    finds_bit_rate: bool = False) -> None:
    """Add --interface, --channel and --bitrate.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    channel : str
        Default of --channel.
    is_set : bool
        False to leave omitted options at None, so that the command can take their values from a file.
    finds_bit_rate : bool
        True to accept --bitrate auto, which sets the option to None.
    """
    read = bit_rate if finds_bit_rate else partial(number, option='--bitrate', kind=int, least=1, unit='bit/s')
    rate = (read, 'bit rate of the bus [bit/s]' + ', or auto' * finds_bit_rate)
    for option, default, kind, text in (('--interface', DEFAULT_INTERFACE, str, 'python-can interface'),
                                        ('--channel', channel, str, 'channel of the interface'),
                                        ('--bitrate', DEFAULT_BITRATE, *rate)):
        parser.add_argument(option, type=kind, default=default if is_set else None, help=f'{text} (default: {default})')


def add_node_id_option(parser: argparse.ArgumentParser) -> None:
    """Add --node-id. If --node-id is not given, the option is None and `pads_of` uses the default."""
    parser.add_argument('--node-id', type=node_ids, action='extend', metavar='ID,...',
                        help=f'CANopen node-ID of each pad (default: {DEFAULT_NODE_ID})')


def add_pads_option(parser: argparse.ArgumentParser) -> None:
    """Add --pads."""
    parser.add_argument('--pads', type=pad_names, default=[], metavar='NAME,...',
                        help='name of each pad (default: a name made from its node-ID)')


def add_any_device_option(parser: argparse.ArgumentParser) -> None:
    """Add --any-device."""
    parser.add_argument('--any-device', action='store_true', help='play a log even if its SDO responses show a '
                        'different device or TPDO mapping; taxels may then be in the wrong places')


def add_output_option(parser: argparse.ArgumentParser, *names: str, **properties: Any) -> None:
    """Add the option for an output file, and --force, which `check_writable` reads.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    *names : str
        Names of the option (default: -o and --output).
    **properties : Any
        Keyword arguments of argparse's add_argument.
    """
    parser.add_argument(*(names or ('-o', '--output')), **properties)
    parser.add_argument('--force', action='store_true', help='replace an existing file; without --force, nothing is '
                        'overwritten')


def add_log_options(parser: argparse.ArgumentParser) -> None:
    """Add --layout, --node-id, --channel and --any-device, for a log of pads with the same layout."""
    parser.add_argument('--layout', default=DEFAULT_LAYOUT, help='skin layout (default: %(default)s)')
    add_node_id_option(parser)
    parser.add_argument('--channel', default='', help='name of the bus to play from a log of several buses, for '
                        'example can0; for a bag, the topic')
    add_any_device_option(parser)


def add_model_option(parser: argparse.ArgumentParser) -> None:
    """Add --model, which `recogniser_of` reads."""
    parser.add_argument('--model', default='', metavar='FILE', help='model of the recogniser, for example a file of '
                        '`tactile teach` or `tactile assess` (default: the model of the package)')


def recogniser_of(args: argparse.Namespace) -> 'VisibilityGuard':
    """Return a recogniser with the model from --model. Raises ConfigurationError if the file cannot be used."""
    from tactile_node.shape.methods import make_recogniser  # scipy would slow down shell completion
    return make_recogniser(LEARNED, args.model)


def add_skin_options(parser: argparse.ArgumentParser) -> None:
    """Add --node-id, --layout and --eds.

    Options that are not given are None, and `pads_of` and `eds_of` use the defaults.
    """
    add_node_id_option(parser)
    parser.add_argument('--layout', type=names, metavar='LAYOUT,...',
                        help=f'skin layout of each pad, or one for all (default: {DEFAULT_LAYOUT})')
    parser.add_argument('--eds', type=names, metavar='EDS,...',
                        help="EDS of each pad, or one for all (default: the layout's name with .eds)")


def pads_of(args: argparse.Namespace, names: Sequence[str] = ()) -> 'tuple[PadSettings, ...]':
    """Return the pads that --node-id and --layout describe.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.
    names : Sequence[str]
        Names of the pads, or empty to derive the names from the node-IDs.

    Raises
    ------
    ConfigurationError
        Raised if a layout cannot be used, or if the options contradict each other.
    """
    from tactile_node.skin.pads import make_pads  # canopen would slow down shell completion
    layouts = [args.layout] if isinstance(args.layout, str) else args.layout or [DEFAULT_LAYOUT]
    node_ids = args.node_id or [DEFAULT_NODE_ID]
    try:
        return make_pads(layouts, node_ids, names)
    except ConfigurationError as error:
        if not names or error.where != 'node-IDs':
            raise
        raise ConfigurationError(
            '--node-id, --pads', expected=error.expected, got=f'node-IDs {", ".join(map(str, node_ids))} and the pads '
            f'{", ".join(names)}', remedy='Give as many names as there are pads, or leave out --pads.') from None


def live_pads_of(args: argparse.Namespace, names: Sequence[str] = ()) -> 'tuple[LivePad, ...]':
    """Return the pads from `pads_of` with the object dictionaries from --eds, which a live bus needs.

    Raises ConfigurationError if a layout or an EDS cannot be used.
    """
    from tactile_node.skin.pads import with_dictionaries
    return with_dictionaries(pads_of(args, names), eds_of(args))


def single_pad_of(args: argparse.Namespace, remedy: str) -> 'PadSettings':
    """Return the pad described by the options. Raises ConfigurationError with ``remedy`` if there are several pads."""
    pads = pads_of(args)
    if len(pads) > 1:
        raise ConfigurationError('--node-id', expected='the nodes of one pad', got=f'{len(pads)} pads', remedy=remedy)
    return pads[0]


def bus_settings_of(args: argparse.Namespace, record: str = '') -> BusSettings:
    """Return the settings of the bus, with defaults for options that are not given.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.
    record : str
        Path of the log to record, or '' to record nothing.
    """
    return BusSettings(args.interface or DEFAULT_INTERFACE, args.channel or DEFAULT_CHANNEL,
                       args.bitrate or DEFAULT_BITRATE, record=record)


def eds_of(args: argparse.Namespace) -> list[str]:
    """Return the EDS files from --eds, where '' means the EDS that belongs to the layout."""
    return args.eds or ['']


@contextmanager
def open_network(args: argparse.Namespace, on_batch: 'Callable[[Batch], None]') -> 'Iterator[BusNetwork]':
    """Open the bus described by the options of `add_bus_options`, and close it on exit.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.
    on_batch : Callable[[Batch], None]
        Function called with received messages.

    Raises
    ------
    BusError
        Raised if the bus cannot be opened, or on exit if the bus failed in the meantime.
    """
    # python-can would slow down shell completion
    from tactile_node.bus.bus_network import BusNetwork
    from tactile_node.bus.open_bus import open_bus
    failures: list[Exception] = []
    network = BusNetwork(open_bus(args.interface, args.channel, args.bitrate), on_batch,
                         lambda fault, error: failures.append(error), name=f'{args.interface} {args.channel}')
    try:
        yield network
    finally:
        network.close()
    if failures:
        raise BusError(f'CAN bus {args.interface} {args.channel}', expected='to continue receiving',
                       got=str(failures[0]), remedy='Check the adapter.')
