"""Publish the time of a replayed log, and wait for the end of the replay."""

from threading import Event

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

from tactile_node.nodes.spinner import Spinner
from tactile_node.nodes.system import System
from tactile_node.ros.time_messages import time_message

CLOCK_STEP = 0.01  #: Interval in log time between two messages on /clock [s].


class ClockOutput:
    """Publishes the time of a log during its replay, for nodes with use_sim_time. The time never goes backwards."""

    def __init__(self, node: Node):
        self._node = node
        self._due = 0.0
        self._publisher = node.create_publisher(Clock, '/clock', QoSProfile(depth=1))

    def show(self, stamp: float) -> None:
        """Publish the time if it has advanced by CLOCK_STEP.

        Parameters
        ----------
        stamp : float
            Stamp of the CAN frame that is being played [s, Unix epoch].
        """
        if stamp >= self._due:
            self._due = stamp + CLOCK_STEP
            self._publisher.publish(Clock(clock=time_message(stamp)))

    def destroy(self) -> None:
        """Stop publishing."""
        self._node.destroy_publisher(self._publisher)


def play(system: System, spinner: Spinner, stop_requested: Event) -> int:
    """Wait for the end of the replay and print a summary. The log waits until each of its taxel frames is processed.

    Parameters
    ----------
    system : System
        Nodes of this process, including a driver that plays a log.
    spinner : Spinner
        Spinner that runs the nodes.
    stop_requested : threading.Event
        Event that ends the replay early.

    Returns
    -------
    int
        Exit code: 1 if the replay was stopped or a taxel frame got no shape, UNREAD_EXIT if parts of the log could not
        be read, otherwise 0.
    """
    # This module is imported here, because nodes without the driver need no CAN library.
    from tactile_node.sources.log_source import UNREAD_EXIT, LogSource, summary
    source = system.source
    if not isinstance(source, LogSource):
        raise RuntimeError(f'expected a log to play, got {type(source).__name__}')
    while not source.finished.wait(0.1) and not stop_requested.is_set():
        spinner.check()
    facts = source.facts()
    published = sum(pad.published for pad in facts.pads)
    print(f'{summary(facts)}\nShapes: {system.recognised} of {published} taxel frames')
    if system.recognised != published or stop_requested.is_set():
        return 1
    return UNREAD_EXIT if facts.unread_log_lines else 0
