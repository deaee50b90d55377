"""What a driver that plays a log adds: the time of the log, and how the replay ends."""

from threading import Event

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

from tactile_node.nodes.spinning import Spinner
from tactile_node.nodes.system import System
from tactile_node.ros.time_messages import time_message

CLOCK_STEP = 0.01  # s of the log between two messages on /clock


class ClockOutput:
    """Publishes the time of a log as it is played, for nodes with use_sim_time; it never goes back."""

    def __init__(self, node: Node):
        self._node = node
        self._due = 0.0
        self._publisher = node.create_publisher(Clock, '/clock', QoSProfile(depth=1))

    def show(self, stamp: float) -> None:
        """The CAN frame stamped ``stamp`` [s, Unix epoch] is played now."""
        if stamp >= self._due:
            self._due = stamp + CLOCK_STEP
            self._publisher.publish(Clock(clock=time_message(stamp)))

    def destroy(self) -> None:
        self._node.destroy_publisher(self._publisher)


def play(system: System, spinner: Spinner, stop_requested: Event) -> int:
    """Wait for the log's end; print the outcome. The log waits for the answer to each of its frames.

    Returns the exit code: 1 when frames did not come out as shapes, else UNREAD_EXIT when something in the log could
    not be read.
    """
    # only here: nodes without the driver need no CAN library
    from tactile_node.sources.log_source import UNREAD_EXIT, LogSource, summary
    source = system.source
    if not isinstance(source, LogSource):
        raise RuntimeError(f'expected a log to play, got {type(source).__name__}')
    while not source.finished.wait(0.1) and not stop_requested.is_set():
        spinner.check()
    statistics = source.statistics()
    published = sum(pad.published for pad in statistics.pads.values())
    print(f'{summary(statistics)}\nShapes: {system.recognised} of {published} taxel frames')
    if system.recognised != published or stop_requested.is_set():
        return 1
    return UNREAD_EXIT if statistics.unread else 0
