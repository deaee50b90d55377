"""Options that several sub-commands share; their types raise ConfigurationError for what they cannot read."""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from math import inf, nan
from typing import TYPE_CHECKING, Any

from tactile_node.bus.bus_settings import DEFAULT_BITRATE, DEFAULT_CHANNEL, DEFAULT_INTERFACE, BusSettings
from tactile_node.cia301.objects import MAX_NODE_ID
from tactile_node.errors import BusError, ConfigurationError
from tactile_node.logs.replay_times import TimeWindow
from tactile_node.shape.recognition import LEARNED

if TYPE_CHECKING:
    from tactile_node.bus.bus_network import BusNetwork
    from tactile_node.bus.reception import Batch
    from tactile_node.shape.methods import VisibilityGuard
    from tactile_node.skin.pads import LivePad, PadSettings

DEFAULT_LAYOUT = 'sim16x16.yaml'
DEFAULT_NODE_ID = 32


def node_ids(text: str) -> list[int]:
    """'32,0x40' -> [32, 64]; with ``action='extend'`` the option may also be repeated."""
    return [number(part, '--node-id', int, least=1, most=MAX_NODE_ID, remedy='For example --node-id 32,64.')
            for part in text.split(',')]


def names(text: str) -> list[str]:
    """'left,right' -> ['left', 'right']."""
    return [part.strip() for part in text.split(',') if part.strip()]


def pad_names(text: str) -> list[str]:
    """Return the names as `names` does; one with a blank is taken for several that no comma separates."""
    if any(len(name.split()) > 1 for name in names(text)):
        raise ConfigurationError('--pads', expected='names separated by commas', got=repr(text),
                                 remedy='For example --pads left,right.')
    return names(text)


def number(text: str, option: str, kind: type = float, *, least: float = 0, above: float = -inf, most: float = inf,
           unit: str = '', remedy: str = 'Correct the number.') -> Any:
    """Return the number of ``kind`` in ``text``. Raises ConfigurationError where it is none, or out of its range.

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
    """Add ``option`` with ``properties`` as of argparse, and its ``limits`` as of `number`."""
    parser.add_argument(option, type=partial(number, option=option, kind=kind, **limits), **properties)


def add_window_options(parser: argparse.ArgumentParser) -> None:
    """Add --start and --duration; `window_of` reads them."""
    limits = {'unit': 's', 'remedy': 'For example --start 1800 --duration 60.'}
    add_number(parser, '--start', limits=limits, default=0.0, metavar='S', help='leave out the first S s of the '
               'recording; of a bag (.mcap, .db3) they are not read')
    add_number(parser, '--duration', limits=limits, metavar='S', help='length of what is read [s] (default: all)')


def window_of(args: argparse.Namespace) -> TimeWindow:
    return TimeWindow(args.start, inf if args.duration is None else args.duration)


def switch(text: str) -> bool:
    """'true' -> True; as ROS writes it, in any case, or as 1 and 0."""
    if text.lower() not in ('true', 'false', '1', '0'):
        raise ConfigurationError('a switch', expected='true or false', got=repr(text), remedy='Write one of them.')
    return text.lower() in ('true', '1')


def bit_rate(text: str) -> int | None:
    """'500000' -> 500000; 'auto' -> None."""
    return None if text == 'auto' else number(text, '--bitrate', int, least=1, unit='bit/s, or auto',
                                              remedy='For example --bitrate 500000.')


def add_bus_options(parser: argparse.ArgumentParser, *, channel: str = DEFAULT_CHANNEL, is_set: bool = True,
                    finds_bit_rate: bool = False) -> None:
    """Add --interface, --channel and --bitrate; not ``is_set``: None where not given, which leaves them to a file.

    A command that ``finds_bit_rate`` gets None for --bitrate auto.
    """
    read = bit_rate if finds_bit_rate else partial(number, option='--bitrate', kind=int, least=1, unit='bit/s')
    rate = (read, 'bit rate of the bus [bit/s]' + ', or auto' * finds_bit_rate)
    for option, default, kind, text in (('--interface', DEFAULT_INTERFACE, str, 'python-can interface'),
                                        ('--channel', channel, str, 'channel of the interface'),
                                        ('--bitrate', DEFAULT_BITRATE, *rate)):
        parser.add_argument(option, type=kind, default=default if is_set else None, help=f'{text} (default: {default})')


def add_node_id_option(parser: argparse.ArgumentParser) -> None:
    """Add --node-id; None where not given: `pads_of` has the default."""
    parser.add_argument('--node-id', type=node_ids, action='extend', metavar='ID,...',
                        help=f'CANopen node-ID of each pad (default: {DEFAULT_NODE_ID})')


def add_pads_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--pads', type=pad_names, default=[], metavar='NAME,...',
                        help='name of each pad (default: after its node-ID)')


def add_any_device_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--any-device', action='store_true', help='play also where the SDO answers in the log show '
                        'another device, or another mapping of its TPDOs: taxels may be in wrong places')


def add_output_option(parser: argparse.ArgumentParser, *names: str, **properties: Any) -> None:
    """Add --output, or ``names``, with ``properties``, and the --force that `check_writable` needs to replace it."""
    parser.add_argument(*(names or ('-o', '--output')), **properties)
    parser.add_argument('--force', action='store_true', help='replace what exists; without, nothing is overwritten')


def add_log_options(parser: argparse.ArgumentParser) -> None:
    """Add --layout, --node-id, --channel and --any-device, for a log of pads of one layout."""
    parser.add_argument('--layout', default=DEFAULT_LAYOUT, help='skin layout (default: %(default)s)')
    add_node_id_option(parser)
    parser.add_argument('--channel', default='', help='bus to play from a log of several buses, as the log names it '
                        '(can0); for a bag, the topic')
    add_any_device_option(parser)


def add_model_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--model', default='', metavar='FILE', help='weights of the recogniser, such as one of '
                        '`tactile teach` or `tactile assess` (default: those of the package)')


def recogniser_of(args: argparse.Namespace) -> 'VisibilityGuard':
    from tactile_node.shape.methods import make_recogniser  # scipy: only where it is needed
    return make_recogniser(LEARNED, args.model)


def add_skin_options(parser: argparse.ArgumentParser) -> None:
    """Add --node-id, --layout and --eds; None where not given: `pads_of` and `eds_of` have defaults."""
    add_node_id_option(parser)
    parser.add_argument('--layout', type=names, metavar='LAYOUT,...',
                        help=f'skin layout of each pad, or one for all (default: {DEFAULT_LAYOUT})')
    parser.add_argument('--eds', type=names, metavar='EDS,...',
                        help="EDS of each pad, or one for all (default: the layout's name with .eds)")


def pads_of(args: argparse.Namespace, names: Sequence[str] = ()) -> 'tuple[PadSettings, ...]':
    """Return the pads of the options --node-id and --layout. Raises ConfigurationError."""
    from tactile_node.skin.pads import make_pads  # canopen, of which completion must not wait
    layouts = [args.layout] if isinstance(args.layout, str) else args.layout or [DEFAULT_LAYOUT]
    return make_pads(layouts, args.node_id or [DEFAULT_NODE_ID], names)


def live_pads_of(args: argparse.Namespace, names: Sequence[str] = ()) -> 'tuple[LivePad, ...]':
    """Return the pads with the EDS of --eds, as a live bus needs them. Raises ConfigurationError."""
    from tactile_node.skin.pads import with_dictionaries
    return with_dictionaries(pads_of(args, names), eds_of(args))


def single_pad_of(args: argparse.Namespace, remedy: str) -> 'PadSettings':
    """Return the only pad of the options. Raises ConfigurationError, with ``remedy``, where they name several."""
    pads = pads_of(args)
    if len(pads) > 1:
        raise ConfigurationError('--node-id', expected='the nodes of one pad', got=f'{len(pads)} pads', remedy=remedy)
    return pads[0]


def bus_settings_of(args: argparse.Namespace, record: str = '') -> BusSettings:
    """Return the settings of a bus whose options may not be given."""
    return BusSettings(args.interface or DEFAULT_INTERFACE, args.channel or DEFAULT_CHANNEL,
                       args.bitrate or DEFAULT_BITRATE, record=record)


def eds_of(args: argparse.Namespace) -> list[str]:
    return args.eds or ['']


@contextmanager
def open_network(args: argparse.Namespace, on_batch: 'Callable[[Batch], None]') -> 'Iterator[BusNetwork]':
    """The bus that the options of `add_bus_options` name. Raises BusError, also where it fails meanwhile."""
    from tactile_node.bus.bus_network import BusNetwork, open_bus  # python-can, of which completion must not wait
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
