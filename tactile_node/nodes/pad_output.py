"""The topic `<pad>/taxels` of one pad."""

import math
import time
from collections.abc import Callable

from rclpy.node import Node

from tactile_node.conditioning.conditioned_pad import ConditionedPad, PadCondition
from tactile_node.nodes.guarded_subscription import publisher_names
from tactile_node.nodes.hand_over import HandOver, StageOutput
from tactile_node.pose.pipeline import Taxels
from tactile_node.pose.profiles import Layer
from tactile_node.ros.contact_messages import PadFrame, taxel_array_message
from tactile_node.ros.settings import DriverSettings
from tactile_node.skin.pads import PadSettings
from tactile_node.taxel_frame import TaxelFrame
from tactile_skin.msg import TaxelArray

LOOK_PERIOD = 1.0  # s between two looks for other publishers


class PadOutput:
    """Conditions the frames of ``pad`` and sends them on; ``layer``: of a calibrated skin; ``age``: see FrameSource.

    A lossless one waits until each is answered, where all stages up to the shape are of this process.
    """

    def __init__(self, node: Node, pad: PadSettings, frame_id: str, conditioned: ConditionedPad,
                 settings: DriverSettings, hand_over: HandOver, age: Callable[[float], float],
                 layer: Layer | None = None):
        self.conditioned = conditioned
        self.unit = pad.layout.value.unit
        self._taxels = Taxels(pad.layout.pitch, self.unit, layer, pad.layout.finger_ends)
        self._frame_id = frame_id
        self._age = age
        self._node = node
        self._output = StageOutput(node, TaxelArray, f'{pad.name}/taxels', settings, taxel_array_message, hand_over)
        self._hand_over = hand_over
        self.is_answered = hand_over.is_complete(self._output.topic)  #: its frames come out as shapes in this process
        self._waits = bool(settings.replay) and settings.lossless and self.is_answered
        self._others: tuple[str, ...] = ()
        self._looked = -math.inf

    @property
    def condition(self) -> PadCondition:
        return self.conditioned.condition._replace(other_publishers=self._other_publishers())

    def publish(self, frame: TaxelFrame) -> None:
        conditioned = PadFrame.of(self.conditioned.feed(frame), self._taxels, self._frame_id)
        self._output.send(conditioned, acquired=time.monotonic() - self._age(frame.stamp))
        if self._waits:
            self._hand_over.wait_until_answered()

    def _other_publishers(self) -> tuple[str, ...]:
        """Full names of the other nodes that publish on our topic, looked up once a second; also one of our name."""
        now = time.monotonic()
        if now - self._looked >= LOOK_PERIOD:
            self._looked = now
            names = publisher_names(self._node, self._output.topic)
            own = self._node.get_fully_qualified_name()
            if names:  # one of them is ours, whose name may not be discovered yet
                names.remove(own if own in names else names[0])
            self._others = tuple(names)
        return self._others

    def destroy(self) -> None:
        self._output.end()
