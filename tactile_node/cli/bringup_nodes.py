"""The nodes that `tactile bringup` runs, by its options."""

import argparse
from collections.abc import Mapping

from tactile_node.errors import ConfigurationError
from tactile_node.launching.arguments import EVERY, PARAMETERS, is_of
from tactile_node.node_graph import NodeDescription, ParameterValue, Role, Side, bus_nodes, roles_of

SIMULATED_CHANNEL = 'tactile_bringup'


def described(args: argparse.Namespace, namespace: str) -> tuple[NodeDescription, ...]:
    """The nodes of this process, with the parameters that were given. Raises ConfigurationError."""
    if args.replay and args.side:
        raise ConfigurationError('--replay', expected='all nodes of the bus in one process',
                                 got=f'--side {args.side}', remedy='Leave --side out.')
    if args.side:
        _check_side(args)
    of_driver = _parameters(args, PARAMETERS[Role.DRIVER]) | _source_parameters(args)
    every = _parameters(args, EVERY) | ({'lossless': True} if args.replay else {})
    nodes = bus_nodes(args.pads, driver=of_driver, every=every,
                      classifier=_parameters(args, PARAMETERS[Role.CLASSIFIER]),
                      grasp=_parameters(args, PARAMETERS[Role.GRASP]), namespace=namespace)
    return tuple(node for node in nodes if node.role in roles_of(Side(args.side))) if args.side else nodes


def _check_side(args: argparse.Namespace) -> None:
    """Raises ConfigurationError for an option that no node of this side reads: it belongs on the other host."""
    for option in sorted({option for table in PARAMETERS.values() for option in table} | {'simulate'}):
        if getattr(args, option) is not None and not is_of(Side(args.side), option):
            raise ConfigurationError(f'--{option.replace("_", "-")}', expected='an option of a node of this side',
                                     got=f'--side {args.side}', remedy='Give it on the other host.')


def _source_parameters(args: argparse.Namespace) -> dict[str, ParameterValue]:
    """What takes the place of a bus."""
    if args.simulate:
        return {'interface': 'virtual', 'channel': SIMULATED_CHANNEL}
    return {'autostart': True} if args.replay else {}  # also where the parameter file says false


def _parameters(args: argparse.Namespace, options: Mapping[str, str]) -> dict[str, ParameterValue]:
    """Only what was given: the rest is left to the parameter file and the defaults."""
    return {parameter: value for option, parameter in options.items() if (value := getattr(args, option)) is not None}
