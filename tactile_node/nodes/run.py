"""How every executable of ours runs its node: errors told in a sentence, Ctrl-C quiet, exit code true."""

import sys
from collections.abc import Callable

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from tactile_node.errors import TactileError


def run_node(make: Callable[[], Node], start: Callable[[Node], None] = lambda node: None) -> int:
    """Spin the node that ``make`` returns, after ``start`` has been called on it.

    Returns the exit code: 0 after Ctrl-C or shutdown, 2 for a TactileError, whose sentence goes to stderr.
    """
    rclpy.init()
    try:
        node = make()
        try:
            start(node)
            rclpy.spin(node)
        finally:
            node.destroy_node()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except TactileError as error:
        print(f'{sys.argv[0].rsplit("/", 1)[-1]}: error: {error}', file=sys.stderr)
        return 2
    finally:
        rclpy.try_shutdown()
    return 0
