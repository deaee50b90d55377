"""The output of the driver for one pad."""

import math
import time

from rclpy.node import Node

from tactile_node.conditioning.conditioned_pad import ConditionedPad, PadCondition
from tactile_node.nodes.stage import StageOutput, Stages
from tactile_node.pose.pipeline import Taxels
from tactile_node.pose.profiles import Layer
from tactile_node.ros.contact_messages import PadFrame, taxel_array_message
from tactile_node.ros.publishers import publisher_names
from tactile_node.ros.settings import DriverSettings
from tactile_node.skin.pads import PadSettings
from tactile_node.taxel_frame import TaxelFrame
from tactile_skin.msg import TaxelArray

LOOK_PERIOD = 1.0  #: Time between two checks for other publishers [s].


class PadOutput(StageOutput[PadFrame]):
    """Conditions the taxel frames of one pad, sends them on `<pad>/taxels`, and knows the condition of the pad.

    Parameters
    ----------
    node : Node
        Node that publishes.
    pad : PadSettings
        Settings of the pad.
    frame_id : str
        Coordinate frame of the pad.
    conditioned : ConditionedPad
        Conditioning stage of the pad.
    settings : DriverSettings
        Settings of the driver.
    stages : Stages
        Stages of this process.
    layer : Layer or None
        Elastic layer of a calibrated skin, or None if the layer is not known.
    """

    def __init__(self, node: Node, pad: PadSettings, frame_id: str, conditioned: ConditionedPad,
                 settings: DriverSettings, stages: Stages, layer: Layer | None = None):
        super().__init__(node, TaxelArray, f'{pad.name}/taxels', settings, taxel_array_message, stages)
        self.conditioned = conditioned
        self._is_mirrored = pad.layout.is_mirrored
        self.unit = pad.layout.value.unit
        self._taxels = Taxels(pad.layout.pitch, self.unit, layer, pad.layout.finger_ends)
        self._frame_id = frame_id
        self._others: tuple[str, ...] = ()
        self._looked = -math.inf

    def send_frame(self, frame: TaxelFrame) -> None:
        """Condition a taxel frame of the pad and send it, on the chain thread."""
        self.send(PadFrame.of(self.conditioned.feed(frame), self._taxels, self._frame_id))

    @property
    def condition(self) -> PadCondition:
        """State of the conditioning stage, and the other publishers of the topic."""
        return self.conditioned.condition._replace(other_publishers=self._other_publishers(),
                                                     is_mirrored=self._is_mirrored)

    def _other_publishers(self) -> tuple[str, ...]:
        """Return the full names of the other nodes that publish on the same topic. The names are read once a second.

        The result includes any other node with the same name as this node.
        """
        now = time.monotonic()
        if now - self._looked >= LOOK_PERIOD:
            self._looked = now
            names = publisher_names(self._node, self.topic)
            own = self._node.get_fully_qualified_name()
            if names:  # one of the names belongs to this node, even if ROS has not discovered the node's own name yet
                names.remove(own if own in names else names[0])
            self._others = tuple(names)
        return self._others
