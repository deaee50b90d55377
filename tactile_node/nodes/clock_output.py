"""The topic /clock of a replay: the time of the log."""

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

from tactile_node.ros.time_messages import time_message

STEP = 0.01  # s of the log between two messages


class ClockOutput:
    """Publishes the time of a log as it is played, for nodes with use_sim_time; it never goes back."""

    def __init__(self, node: Node):
        self._node = node
        self._due = 0.0
        self._publisher = node.create_publisher(Clock, '/clock', QoSProfile(depth=1))

    def show(self, stamp: float) -> None:
        """The CAN frame stamped ``stamp`` [s, Unix epoch] is played now."""
        if stamp >= self._due:
            self._due = stamp + STEP
            self._publisher.publish(Clock(clock=time_message(stamp)))

    def destroy(self) -> None:
        self._node.destroy_publisher(self._publisher)
