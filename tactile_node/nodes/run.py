"""How every executable of ours runs its node: errors told in a sentence, Ctrl-C quiet, exit code true."""

import gc
import sys
from collections.abc import Callable
from threading import Event

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from tactile_node.errors import TactileError
from tactile_node.interruption import ignore_interruptions, interruption
from tactile_node.nodes.spinning import Spinner, spinning
from tactile_node.ros.rclpy_errors import told_as_ours
from tactile_node.ros.rosout_handler import forward_logs_to, stop_forwarding_to


def run_node(make: Callable[[], Node], start: Callable[[Node, Event], None] = lambda node, asked: None) -> int:
    """Spin the node that ``make`` returns until SIGINT or SIGTERM, which set ``asked``; first call ``start`` on it.

    Signals are ours, not rclpy's, which invalidates the context under the executor's feet.
    Returns the exit code: 0 when asked to end, 2 for a TactileError, whose sentence goes to stderr.
    """
    try:
        return _run(make, start)
    finally:
        ignore_interruptions()


def _run(make: Callable[[], Node], start: Callable[[Node, Event], None]) -> int:
    with interruption() as asked:
        try:
            with told_as_ours():
                rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
                node = make()
            forward_logs_to(node)
            try:
                with spinning([node]) as spinner:
                    start(node, asked)
                    wait(spinner, asked)
            finally:
                node.destroy_node()
                stop_forwarding_to(node)
        except TactileError as error:
            print(f'{sys.argv[0].rsplit("/", 1)[-1]}: error: {error}', file=sys.stderr)
            return 2
        finally:
            rclpy.try_shutdown()
    return 0


def wait(spinner: Spinner, asked) -> None:
    """Return when the event ``asked`` is set; raise what a callback has raised meanwhile.

    All that has been made until now lives on: left to the garbage collector, it would hold up frames for some 40 ms at
    each full collection.
    """
    gc.freeze()
    while not asked.wait(0.2):
        spinner.check()
