"""The topic `<pad>/taxels` of one pad."""

import math
import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import QoSProfile

from tactile_node.conditioning.conditioned_pad import ConditionedPad, PadCondition
from tactile_node.nodes.guarded_subscription import publisher_names
from tactile_node.pose.profiles import Layer
from tactile_node.ros.contact_messages import taxel_array_message
from tactile_node.ros.message_age import age_message
from tactile_node.skin.pads import PadSettings
from tactile_node.taxel_frame import TaxelFrame
from tactile_skin.msg import TaxelArray

LOOK_PERIOD = 1.0  # s between two looks for other publishers


class PadOutput:
    """Conditions the frames of ``pad`` and publishes them; ``layer``: of a calibrated skin."""

    def __init__(self, node: Node, pad: PadSettings, frame_id: str, conditioned: ConditionedPad, *, qos: QoSProfile,
                 layer: Layer | None = None):
        self.conditioned = conditioned
        self.unit = pad.layout.value.unit
        self._pitch = pad.layout.pitch
        self._frame_id = frame_id
        self._layer = layer
        self._node = node
        self._publisher = node.create_publisher(TaxelArray, f'{pad.name}/taxels', qos)
        self._topic = self._publisher.topic_name  # its publisher may be destroyed while the state is looked at
        self._others: tuple[str, ...] = ()
        self._looked = -math.inf

    @property
    def condition(self) -> PadCondition:
        return self.conditioned.condition._replace(other_publishers=self._other_publishers())

    def publish(self, frame: TaxelFrame, age: Callable[[float], float]) -> None:
        """``age``: the stamp of a frame -> the time since its acquisition [s], by the steady clock."""
        message = taxel_array_message(self.conditioned.feed(frame), self._pitch, self.unit, self._frame_id,
                                      self._layer)
        message.age = age_message(age(frame.stamp))
        self._publisher.publish(message)

    def _other_publishers(self) -> tuple[str, ...]:
        """Full names of the other nodes that publish on our topic, looked up once a second; also one of our name."""
        now = time.monotonic()
        if now - self._looked >= LOOK_PERIOD:
            self._looked = now
            names = publisher_names(self._node, self._topic)
            own = self._node.get_fully_qualified_name()
            if names:  # one of them is ours, whose name may not be discovered yet
                names.remove(own if own in names else names[0])
            self._others = tuple(names)
        return self._others

    def destroy(self) -> None:
        self._node.destroy_publisher(self._publisher)
