"""The nodes that `tactile bringup` runs, by its options."""

import argparse
from collections.abc import Mapping

from tactile_node.errors import ConfigurationError
from tactile_node.launching.arguments import EVERY, PARAMETERS, is_read_by
from tactile_node.node_graph import (
    NodeDescription,
    ParameterValue,
    Role,
    Side,
    Split,
    bus_nodes,
    chosen,
    of_side,
    roles_of,
)

SIMULATED_CHANNEL = 'tactile_bringup'


def described(args: argparse.Namespace, namespace: str) -> tuple[NodeDescription, ...]:
    """The nodes of this process, with the parameters that were given. Raises ConfigurationError."""
    if args.replay and (args.only or args.side):
        raise ConfigurationError('--replay', expected='all nodes of the bus in one process',
                                 got='--only' if args.only else '--side',
                                 remedy='Leave it out (in a launch: processes:=one).')
    if args.split and not args.side:
        raise ConfigurationError('--split', expected='--side beside it', got='none',
                                 remedy=f'Add --side {Side.BUS.value} or --side {Side.PERCEPTION.value}.')
    of_driver = _parameters(args, PARAMETERS[Role.DRIVER]) | _source_parameters(args)
    every = _parameters(args, EVERY) | ({'lossless': True} if args.replay else {})
    nodes = bus_nodes(args.pads, driver=of_driver, every=every,
                      classifier=_parameters(args, PARAMETERS[Role.CLASSIFIER]),
                      grasp=_parameters(args, PARAMETERS[Role.GRASP]), namespace=namespace)
    if args.only:
        return chosen(nodes, args.only)
    return of_side(nodes, *_side(args)) if args.side else nodes


def _side(args: argparse.Namespace) -> tuple[Side, Split]:
    """Raises ConfigurationError for an option that no node of this side reads: it belongs on the other host."""
    side, split = Side(args.side), Split(args.split or Split.TAXELS.value)
    options = {option for table in PARAMETERS.values() for option in table} | {'simulate'}
    for option in sorted(options):
        if getattr(args, option) is not None and not any(
                is_read_by(role, option) for role in roles_of(side, split)):
            raise ConfigurationError(f'--{option.replace("_", "-")}', expected='an option of a node of this side',
                                     got=f'--side {side.value}', remedy='Give it on the other host.')
    return side, split


def _source_parameters(args: argparse.Namespace) -> dict[str, ParameterValue]:
    """What takes the place of a bus."""
    if args.simulate:
        return {'interface': 'virtual', 'channel': SIMULATED_CHANNEL}
    return {'autostart': True} if args.replay else {}  # also where the parameter file says false


def _parameters(args: argparse.Namespace, options: Mapping[str, str]) -> dict[str, ParameterValue]:
    """Only what was given: the rest is left to the parameter file and the defaults."""
    return {parameter: value for option, parameter in options.items() if (value := getattr(args, option)) is not None}
