"""How every executable of ours runs its node: one line for an error, no traceback on Ctrl-C, a correct exit code."""

import gc
import sys
from argparse import ArgumentParser
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from threading import Event
from typing import TypeVar

import rclpy
from rclpy.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidTopicNameException,
    ParameterException,
)
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from tactile_node.errors import ConfigurationError, TactileError
from tactile_node.interruption import ignore_interruptions, interruption, stop_with
from tactile_node.node_graph import NodeDescription
from tactile_node.nodes.spinning import Spinner, spinning
from tactile_node.nodes.system import System
from tactile_node.ros.rosout_handler import forward_logs_to, stop_forwarding_to

SomeNode = TypeVar('SomeNode', bound=Node)
NAME_ERRORS = (InvalidNamespaceException, InvalidNodeNameException, InvalidTopicNameException)


def run_node(make: Callable[[], SomeNode], start: Callable[[SomeNode, Event], None] | None = None) -> int:
    """Spin the node that ``make`` returns until SIGINT or SIGTERM, which set an event; first call ``start`` with both.

    `--end-with PID` sets the event when that process ends: SIGTERM to `ros2 run` leaves its child behind.
    rclpy's signal handlers are off: they invalidate the context while the executor still uses it.
    Returns the exit code: 0 on a signal, 2 for a TactileError, whose message goes to stderr.
    """
    with ExitStack() as stack:
        stack.callback(ignore_interruptions)
        stop_requested = stack.enter_context(interruption())
        stack.callback(rclpy.try_shutdown)
        try:
            with translate_rclpy_errors():
                parser = ArgumentParser(allow_abbrev=False)
                parser.add_argument('--end-with', type=int, metavar='PID', help='end when this process ends')
                end_with = parser.parse_known_args(rclpy.utilities.remove_ros_args(sys.argv)[1:])[0].end_with
                rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
                node = make()
            if end_with is not None:
                stop_with(end_with, stop_requested)
            forward_logs_to(node)
            try:
                with spinning([node]) as spinner:
                    if start is not None:
                        start(node, stop_requested)
                    wait(spinner, stop_requested)
            finally:
                node.destroy_node()
                stop_forwarding_to(node)
        except TactileError as error:
            print(f'{sys.argv[0].rsplit("/", 1)[-1]}: error: {error}', file=sys.stderr)
            return 2
    return 0


def wait(spinner: Spinner, stop_requested: Event) -> None:
    """Return when the event ``stop_requested`` is set; raise what a callback has raised.

    Objects made until now are exempt from garbage collection, whose full runs would delay frames by some 40 ms.
    """
    gc.freeze()
    while not stop_requested.wait(0.2):
        spinner.check()


@contextmanager
def translate_rclpy_errors() -> Iterator[None]:
    """Raise ConfigurationError for what rclpy raises inside the block."""
    try:
        yield
    except NAME_ERRORS as error:
        raise ConfigurationError('namespace or pad name', expected='letters, digits and underscores',
                                 got=' '.join(str(error).split()), remedy='Rename it.') from None
    except ParameterException as error:  # of the parameters that rclpy itself declares, as use_sim_time
        raise ConfigurationError('parameter file or argument', expected='values of the type of each parameter',
                                 got=str(error), remedy='Correct the value.') from None
    except rclpy_implementation.RCLError as error:
        if 'params file' not in str(error):
            raise
        raise ConfigurationError('parameter file', expected='a ROS 2 parameter file (YAML)',
                                 got=str(error).split(', at /')[0], remedy='Check path and indentation.') from None


@contextmanager
def running(nodes: Sequence[NodeDescription], ros_arguments: Sequence[str]) -> Iterator[tuple[System, Spinner]]:
    """Make and spin ``nodes`` inside the block; ``ros_arguments``, which follow `--ros-args`, are for all of them.

    Raises ConfigurationError for a wrong parameter, name or parameter file.
    """
    with ExitStack() as stack:
        stack.callback(rclpy.try_shutdown)
        with translate_rclpy_errors():
            rclpy.init(args=['--ros-args', *ros_arguments], signal_handler_options=SignalHandlerOptions.NO)
            system = System(nodes)
        stack.callback(system.destroy)
        for node in system.nodes:  # the driver, where it is here, has begun already
            forward_logs_to(node)
            stack.callback(stop_forwarding_to, node)
        yield system, stack.enter_context(spinning(system.nodes))
