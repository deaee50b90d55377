"""Run the nodes of an executable.

An error is printed in one line. Ctrl-C ends the process without a traceback. The exit code tells the outcome.
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
from tactile_node.nodes.spinning import Spinner, spinning
from tactile_node.nodes.system import System
from tactile_node.ros.rosout_handler import forward_logs_to, stop_forwarding_to

SomeNode = TypeVar('SomeNode', bound=Node)
NAME_ERRORS = (InvalidNamespaceException, InvalidNodeNameException, InvalidTopicNameException)


def run_node(make: Callable[[], SomeNode], start: Callable[[SomeNode, Event], None] | None = None) -> int:
    """Make a node and spin it until SIGINT or SIGTERM.

    The option `--end-with PID` also ends the node when that process ends, because SIGTERM to `ros2 run` does not end
    its child. rclpy's signal handlers are not installed, because they invalidate the context while the executor still
    uses it.

    Parameters
    ----------
    make : callable
        Makes the node.
    start : callable or None
        Called with the node and an event as soon as the node is spinning. SIGINT, SIGTERM, the option and the callee
        may set the event, which ends the node.

    Returns
    -------
    int
        Exit code: 0 after a signal, 2 for a TactileError, whose message is printed on stderr.
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
    """Wait until an event is set. An exception of a callback is raised here.

    Objects that exist at the call are exempted from garbage collection, because full collections would delay frames by
    about 40 ms.

    Parameters
    ----------
    spinner : Spinner
        Spinner whose exceptions are raised.
    stop_requested : threading.Event
        Event to wait for.
    """
    gc.freeze()
    while not stop_requested.wait(0.2):
        spinner.check()


@contextmanager
def translate_rclpy_errors() -> Iterator[None]:
    """Turn errors of rclpy about names and parameters inside the block into ConfigurationError."""
    try:
        yield
    except NAME_ERRORS as error:
        raise ConfigurationError('namespace or pad name', expected='letters, digits and underscores',
                                 got=' '.join(str(error).split()), remedy='Rename it.') from None
    except ParameterException as error:  # about parameters that rclpy declares, such as use_sim_time
        raise ConfigurationError('parameter file or argument', expected='values of the type of each parameter',
                                 got=str(error), remedy='Correct the value.') from None
    except rclpy_implementation.RCLError as error:
        if 'params file' not in str(error):
            raise
        raise ConfigurationError('parameter file', expected='a ROS 2 parameter file (YAML)',
                                 got=str(error).split(', at /')[0], remedy='Check path and indentation.') from None


@contextmanager
def running(nodes: Sequence[NodeDescription], ros_arguments: Sequence[str]) -> Iterator[tuple[System, Spinner]]:
    """Make nodes and spin them inside the block.

    Parameters
    ----------
    nodes : sequence of NodeDescription
        Nodes to make.
    ros_arguments : sequence of str
        Arguments after `--ros-args`, for all nodes.

    Yields
    ------
    tuple of System and Spinner
        The nodes and their spinner.

    Raises
    ------
    ConfigurationError
        If a parameter, a name or the parameter file is wrong.
    """
    with ExitStack() as stack:
        stack.callback(rclpy.try_shutdown)
        with translate_rclpy_errors():
            rclpy.init(args=['--ros-args', *ros_arguments], signal_handler_options=SignalHandlerOptions.NO)
            system = System(nodes)
        stack.callback(system.destroy)
        for node in system.nodes:  # the driver already does this in its constructor, and a second call is harmless
            forward_logs_to(node)
            stack.callback(stop_forwarding_to, node)
        yield system, stack.enter_context(spinning(system.nodes))
