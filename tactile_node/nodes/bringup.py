"""Runs the nodes of one bus in this process: until it is stopped, or until a log has been played."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from threading import Event
from typing import NamedTuple

import rclpy
from rclpy.signals import SignalHandlerOptions

from tactile_node.node_graph import NodeDescription
from tactile_node.nodes.drain import drain, published_frames
from tactile_node.nodes.run import translate_rclpy_errors
from tactile_node.nodes.spinning import Spinner, spinning
from tactile_node.nodes.system import System
from tactile_node.ros.rosout_handler import forward_logs_to, stop_forwarding_to


class Running(NamedTuple):
    """Nodes and what spins them."""

    system: System
    spinner: Spinner


@contextmanager
def running(nodes: Sequence[NodeDescription], ros_arguments: Sequence[str]) -> Iterator[Running]:
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
        yield Running(system, stack.enter_context(spinning(system.nodes)))


def play(system: System, spinner: Spinner, stop_requested: Event) -> int:
    """Wait for the log's end and for the last of its frames to come out as a shape; print the outcome.

    Returns the exit code: 1 when frames did not come out as shapes.
    """
    # only here: nodes without the driver need no CAN library
    from tactile_node.recording.log_source import LogSource, summary
    source = system.source
    if not isinstance(source, LogSource):
        raise RuntimeError(f'expected a log to play, got {type(source).__name__}')
    while not source.finished.wait(0.1) and not stop_requested.is_set():
        spinner.check()
    recognised, published = drain(source, lambda: system.recognised, spinner, stop_requested), published_frames(source)
    print(f'{summary(source.statistics())}\nShapes: {recognised} of {published} taxel frames')
    return 0 if recognised == published and not stop_requested.is_set() else 1
