"""Use heartbeats to detect other processes that command the same gripper or have the same name.

The ROS graph is no substitute for heartbeats, because it shows a killed process for another 20 s and a hung process
indefinitely.
"""

import logging
import math
from collections.abc import Callable, Sequence
from functools import partial
from uuid import uuid4

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from unique_identifier_msgs.msg import UUID

from tactile_node.ros.rosout_handler import of_node

HEARTBEAT_PERIOD = 0.2  #: Time between two heartbeats of this process [s].
#: Time without a heartbeat after which another process counts as ended [s]. The limit allows for five lost heartbeats.
HOLD_TIME = 1.0
#: Time for which a process must listen before it may close the gripper [s]. ROS discovery takes up to 2.8 s
#: (docs/closing.md).
LISTEN_TIME = 5.0

logger = logging.getLogger(__name__)


class DuplicateWatch:
    """Sends the identity of this process as a heartbeat, and listens for the heartbeats of other processes.

    Parameters
    ----------
    node : Node
        Node of this process.
    topics : sequence of str
        Topics on which heartbeats are sent and received.
    steady : callable
        Steady clock [s].
    """

    def __init__(self, node: Node, topics: Sequence[str], *, steady: Callable[[], float]):
        self._node, self._steady = node, steady
        self._identity = UUID(uuid=list(uuid4().bytes))
        self._heard: dict[str, float] = {}  # topic -> time when another process was last heard [s]
        self._ran = -math.inf  # time of the last heartbeat of this process [s]
        self._listens_since = math.inf  # time when this process started to listen without interruption [s]
        self._logged = ''
        self._publishers = [node.create_publisher(UUID, topic, QoSProfile(depth=10)) for topic in topics]
        for publisher in self._publishers:
            node.create_subscription(UUID, publisher.topic_name, partial(self._hear, publisher.topic_name),
                                     QoSProfile(depth=10))
        node.create_timer(HEARTBEAT_PERIOD, self._run, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics on which another process was heard within the last HOLD_TIME."""
        return tuple(topic for topic, heard in self._heard.items() if self._steady() - heard <= HOLD_TIME)

    @property
    def text(self) -> str:
        """Error text that names the topics on which another process was heard, or '' if none was heard."""
        topics = self.topics
        return '' if not topics else (
            f'closing is disabled, because another touch_gripper or a tactile commission is heard on '
            f'{", ".join(topics)}: stop one of them (`ros2 topic info -v {topics[0]}` lists them)')

    @property
    def has_listened(self) -> bool:
        """True if this process has listened without interruption for at least LISTEN_TIME."""
        now = self._steady()
        return now - self._ran <= HOLD_TIME and now - self._listens_since >= LISTEN_TIME

    def _hear(self, topic: str, message: UUID) -> None:
        if message != self._identity:
            self._heard[topic] = self._steady()

    def _run(self) -> None:
        now = self._steady()
        if now - self._ran > HOLD_TIME:
            self._listens_since = now
        self._ran = now
        for publisher in self._publishers:
            publisher.publish(self._identity)
        if self.text != self._logged:
            self._logged = self.text
            logger.log(logging.ERROR if self._logged else logging.INFO, '%s',
                       self._logged or 'the other touch_gripper has ended', extra=of_node(self._node))
