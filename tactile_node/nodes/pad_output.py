"""The topic `<pad>/taxels` of one pad."""

from rclpy.node import Node
from rclpy.qos import QoSProfile

from tactile_node.conditioning.conditioned_pad import ConditionedPad
from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.ros.taxel_messages import taxel_array_message
from tactile_node.skin.pads import PadSettings
from tactile_skin.msg import TaxelArray


class PadOutput:
    """Conditions the frames of ``pad`` and publishes them."""

    def __init__(self, node: Node, pad: PadSettings, frame_id: str, conditioned: ConditionedPad, *, qos: QoSProfile):
        self.conditioned = conditioned
        self.unit = pad.layout.value.unit
        self._pitch = pad.layout.pitch
        self._frame_id = frame_id or f'{pad.name}_pad'
        self._node = node
        self._publisher = node.create_publisher(TaxelArray, f'{pad.name}/taxels', qos)

    def publish(self, frame: TaxelFrame) -> None:
        conditioned = self.conditioned.feed(frame)
        self._publisher.publish(taxel_array_message(conditioned, self._pitch, self.unit, self._frame_id))

    def destroy(self) -> None:
        self._node.destroy_publisher(self._publisher)
