"""Run the nodes of an executable.

The process prints an error in one line, ends on Ctrl-C without a traceback, and reports success or failure by its exit
code.
"""

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
from tactile_node.nodes.spinner import Spinner, spinning
from tactile_node.nodes.system import System
from tactile_node.ros.rosout_handler import forward_logs_to, stop_forwarding_to

SomeNode = TypeVar('SomeNode', bound=Node)
NAME_ERRORS = (InvalidNamespaceException, InvalidNodeNameException, InvalidTopicNameException)


def run_node(make: Callable[[], SomeNode], start: Callable[[SomeNode, Event], None] | None = None) -> int:
    """Create a node and spin it until SIGINT or SIGTERM.

    With the option `--end-with PID`, the node also ends when the process PID ends, because SIGTERM to `ros2 run` does
    not end its child. The signal handlers of rclpy are not installed, because they invalidate the context while the
    executor still uses it.

    Parameters
    ----------
    make : callable
        Function that creates the node.
    start : callable or None
        Function that is called with the node and an event as soon as the node is spinning. The node ends when the event
        is set: by SIGINT, by SIGTERM, by the option `--end-with`, or by this function.

    Returns
    -------
    int
        Exit code: 0 after a signal, or 2 after a TactileError, whose message is printed to stderr.
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
    """Wait until an event is set. If a callback fails, raise its exception.

    The function first exempts all existing objects from garbage collection, because full collections would delay taxel
    frames by about 40 ms.

    Parameters
    ----------
    spinner : Spinner
        Spinner that runs the callbacks.
    stop_requested : threading.Event
        Event to wait for.
    """
    gc.freeze()
    while not stop_requested.wait(0.2):
        spinner.check()


@contextmanager
def translate_rclpy_errors() -> Iterator[None]:
    """Inside the block, convert rclpy's errors about names and parameters to ConfigurationError."""
    try:
        yield
    except NAME_ERRORS as error:
        raise ConfigurationError('namespace or pad name', expected='letters, digits and underscores',
                                 got=' '.join(str(error).split()), remedy='Rename it.') from None
    except ParameterException as error:  # raised for parameters that rclpy itself declares, such as use_sim_time
        raise ConfigurationError('parameter file or argument', expected='values of the right types',
                                 got=str(error), remedy='Correct the value.') from None
    except rclpy_implementation.RCLError as error:
        if 'params file' not in str(error):
            raise
        raise ConfigurationError('parameter file', expected='a ROS 2 parameter file (YAML)',
                                 got=str(error).split(', at /')[0], remedy='Check its path and indentation.') from None


@contextmanager
def running(nodes: Sequence[NodeDescription], ros_arguments: Sequence[str]) -> Iterator[tuple[System, Spinner]]:
    """Create nodes and spin them inside the block.

    Parameters
    ----------
    nodes : sequence of NodeDescription
        Nodes to create.
    ros_arguments : sequence of str
        Arguments after `--ros-args`, which apply to all nodes.

    Yields
    ------
    tuple of System and Spinner
        The nodes and their spinner.

    Raises
    ------
    ConfigurationError
        Raised if a parameter, a name or the parameter file is invalid.
    """
    with ExitStack() as stack:
        stack.callback(rclpy.try_shutdown)
        with translate_rclpy_errors():
            rclpy.init(args=['--ros-args', *ros_arguments], signal_handler_options=SignalHandlerOptions.NO)
            system = System(nodes)
        stack.callback(system.destroy)
        # the driver has forwarded its logs since its constructor ran, but a second call is harmless
        for node in system.nodes:
            forward_logs_to(node)
            stack.callback(stop_forwarding_to, node)
        yield system, stack.enter_context(spinning(system.nodes))
