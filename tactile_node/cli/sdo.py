"""`tactile sdo` reads or writes one object of a CANopen device, or stores its parameters or restores its defaults.

OBJECT is an index with a sub-index, hexadecimal or decimal: 0x1018:1 or 25601:16. The default sub-index is 0. With
--eds, OBJECT may also be a name from the EDS, such as Identity.Vendor-ID. Hexadecimal numbers need the prefix 0x, even
if the device manual omits the prefix.

A running driver treats a write to 0x1005, 0x1800... or 0x1A00... as a change by another master. The driver then
publishes no values from this node until it has configured the node again (RECONFIGURED).
"""

import argparse
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from math import isfinite

from canopen import ObjectDictionary

from tactile_node.bus.bus_monitor import DECIDES_TPDOS
from tactile_node.bus.own_sdo import OwnSdoClient, read_object, write_object
from tactile_node.cia301 import objects
from tactile_node.cia301.objects import ObjectAddress, parse_address
from tactile_node.cli.options import add_bus_options, add_number, open_network
from tactile_node.errors import ConfigurationError, DeviceError
from tactile_node.skin.eds import load_eds
from tactile_node.skin.object_value import (
    TYPES,
    WrongValueError,
    decode_value,
    encode_value,
    find_declared,
    find_named,
    type_name,
)

SDO_ANSWER_TIMEOUT = 1.0    #: timeout for a response [s]
STORE_TIMEOUT = 10.0        #: timeout for the response to store or restore [s], because flash memory is slow
LONGEST_TIMEOUT = 3600.0    #: maximum value of --timeout [s]
RECONFIGURES = ('this object decides which TPDOs the node sends. A running driver publishes no values from this node '
                'until it has configured the node again')


def add_options(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(required=True, metavar='read|write|store|restore')
    read = _action(actions, 'read', _read, SDO_ANSWER_TIMEOUT, 'print the value of an object')
    write = _action(actions, 'write', _write, SDO_ANSWER_TIMEOUT, 'write the value of an object')
    for action in (read, write):
        action.add_argument('object', metavar='OBJECT', help='index with sub-index, such as 0x1018:1, or a name from '
                            'the EDS')
        action.add_argument('--eds', default='', help='EDS that names the objects and their types: a file, or a name '
                            'in config/')
        action.add_argument('--type', choices=TYPES, help='type of the value; hex: the bytes in transmission order '
                            '(default: the type from the EDS)')
    write.add_argument('value', metavar='VALUE', help='100, 0x64, 1.5, a text, or bytes such as 6400')
    store = partial(_parameters, index=objects.STORE_PARAMETERS, signature=b'save',
                    done='stored its parameters')
    restore = partial(_parameters, index=objects.RESTORE_PARAMETERS, signature=b'load', done="will use its maker's "
                      'parameters after its next reset (power cycle or NMT reset), not before')
    for action in (_action(actions, 'store', store, STORE_TIMEOUT, 'store the parameters: write "save" to 0x1010'),
                   _action(actions, 'restore', restore, STORE_TIMEOUT, "restore the maker's parameters: write \"load\" "
                           'to 0x1011; the device uses them after its next reset')):
        add_number(action, '--sub', int, limits={'least': 1, 'most': objects.MAX_SUBINDEX}, metavar='SUB',
                   default=1, help='group of parameters: 1 all (default), 2 communication, 3 application, 4 and above '
                   'as defined by the maker')


def run(args: argparse.Namespace) -> int:
    """Execute the action. Raises DeviceError if the device refuses the transfer."""
    args.act(args)
    return 0


def _action(actions: argparse._SubParsersAction, name: str, act, timeout: float, text: str) -> argparse.ArgumentParser:
    parser = actions.add_parser(name, help=text, description=text)
    add_bus_options(parser)
    add_number(parser, '--node-id', int, limits={'least': objects.MIN_NODE_ID, 'most': objects.MAX_NODE_ID,
               'remedy': '`tactile scan` lists the nodes of a bus.'}, required=True, metavar='ID',
               help='CANopen node-ID of the device')
    add_number(parser, '--timeout', limits={'above': 0, 'most': LONGEST_TIMEOUT, 'unit': 's'}, default=timeout,
               metavar='SECONDS', help='time allowed for each answer (default: %(default)s)')
    parser.add_argument('--json', action='store_true', help='print one JSON object instead of text')
    parser.set_defaults(act=act)
    return parser


@contextmanager
def _client(args: argparse.Namespace) -> Iterator[OwnSdoClient]:
    with open_network(args, lambda batch: None) as network, \
            network.sdo_client(args.node_id, ObjectDictionary(), args.timeout) as sdo:
        yield sdo


def _read(args: argparse.Namespace) -> None:
    address, kind = _target(args)
    with _client(args) as sdo:
        data = read_object(sdo, address)
    try:
        value = decode_value(kind or 'hex', data)
    except WrongValueError as error:
        raise DeviceError(f'node {args.node_id}, object {address}', expected=f'{error.expected} ({kind})',
                          got=f'{len(data)} bytes: {data.hex()}', remedy='Correct --type or the EDS, or read the '
                          'object with --type hex.') from error
    _report(args, address, kind, data, '=', value)


def _write(args: argparse.Namespace) -> None:
    address, kind = _target(args)
    if kind is None:
        raise ConfigurationError('--type', expected=f'the type of object {address}', got='none',
                                 remedy='Give --type or --eds to set how many bytes are written.')
    try:
        data = encode_value(kind, args.value)
    except WrongValueError as error:
        raise ConfigurationError('VALUE', expected=f'{error.expected} ({kind})', got=repr(args.value),
                                 remedy='Correct the value or --type.') from error
    if address.index in DECIDES_TPDOS:
        print(f'tactile: warning: {RECONFIGURES}.', file=sys.stderr)
    with _client(args) as sdo:
        write_object(sdo, address, data)
    _report(args, address, kind, data, 'set to', decode_value(kind, data))


def _parameters(args: argparse.Namespace, index: int, signature: bytes, done: str) -> None:
    """Write the signature with which a device stores or restores its parameters (CiA 301, 7.5.2.13 and 7.5.2.14)."""
    with _client(args) as sdo:
        write_object(sdo, ObjectAddress(index, args.sub), signature)
    facts = {'node_id': args.node_id, 'sub': args.sub}
    print(json.dumps(facts) if args.json else f'node {args.node_id} {done} (sub {args.sub}).')


def _target(args: argparse.Namespace) -> tuple[ObjectAddress, str | None]:
    """Return the address given as OBJECT, and the type of its value or None if the type is unknown."""
    dictionary = load_eds(args.eds, args.node_id) if args.eds else ObjectDictionary()
    try:
        address = parse_address(args.object)
    except ValueError:
        address = _named(args, dictionary)
    variable = find_declared(dictionary, address)
    return address, args.type or (type_name(variable.data_type) if variable else None)


def _named(args: argparse.Namespace, dictionary: ObjectDictionary) -> ObjectAddress:
    found = find_named(dictionary, args.object) if args.eds else []
    if len(found) == 1:
        return found[0]
    got, remedy = repr(args.object), 'Write 0x before all hexadecimal digits, also before four of them: 0x6401:1.'
    if found:
        got, remedy = f'{got}, which names {", ".join(map(str, found[:4]))}', 'Give the index, or OBJECT.SUB-OBJECT.'
    raise ConfigurationError('OBJECT', expected='an index with sub-index such as 0x1018:1'
                             + (f', or the name of one value in {args.eds}' if args.eds else ''),
                             got=got, remedy=remedy)


def _report(args: argparse.Namespace, address: ObjectAddress, kind: str | None, data: bytes, verb: str,
            value: int | float | str) -> None:
    if args.json:
        is_json = not isinstance(value, float) or isfinite(value)  # JSON supports neither NaN nor infinity
        print(json.dumps({'node_id': args.node_id, 'index': address.index, 'sub': address.sub, 'type': kind,
                          'value': value if is_json else None, 'data': data.hex()}))
        return
    number = f'{value} (0x{value:X})' if isinstance(value, int) and value > 9 else \
        repr(value) if kind == 'str' else str(value)
    print(f'node {args.node_id}, object {address} {verb} {number}' + ('' if kind else f', {len(data)} bytes'))
