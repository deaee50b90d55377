"""A bus for a command that is done in seconds: what fails meanwhile ends it."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tactile_node.bus.bus_network import BusNetwork, open_bus
from tactile_node.bus.reception import Batch
from tactile_node.errors import BusError


@contextmanager
def opened_network(args: argparse.Namespace, on_batch: Callable[[Batch], None]) -> Iterator[BusNetwork]:
    """The bus that the options of `add_bus_options` name. Raises BusError, also where it fails meanwhile."""
    failures: list[Exception] = []
    network = BusNetwork(open_bus(args.interface, args.channel, args.bitrate, {}), on_batch,
                         lambda fault, error: failures.append(error), name=f'{args.interface} {args.channel}')
    try:
        yield network
    finally:
        network.close()
    if failures:
        raise BusError(f'CAN bus {args.interface} {args.channel}', expected='to continue receiving',
                       got=str(failures[0]), remedy='Check the adapter.')
