"""Process taxels into grasp messages with the functions of the nodes, but with a simulated clock and no nodes."""

import numpy as np

from tactile_node.grasp.gripper import Gripper, PadPose
from tactile_node.grasp.opening import GapSource, Opening
from tactile_node.grasp.tracker import SIDES, GraspSettings, GraspTracker
from tactile_node.pose.pipeline import ContactPipeline, Taxels
from tactile_node.ros.contact_messages import PadContact, PadFrame
from tactile_node.ros.grasp_messages import CurrentGrasp, grasp_message, side_result
from tactile_node.ros.message_age import age_message
from tactile_node.ros.shape_messages import PadShape, pad_shape_of
from tactile_node.shape.methods import make_recogniser
from tactile_node.taxel_frame import NO_SIDE, SkinSide, TaxelFrame, TaxelStatus
from tactile_skin.msg import ContactShape, Grasp

PITCH = 0.002  #: [m]
UNIT = 'Pa'
DELAY = 0.02   #: Time from the acquisition of a frame to its grasp [s].
EPOCH = 1.7e9  #: [s]
GRIPPER = Gripper(PadPose(), PadPose((0.0, 0.03, 0.0), (np.pi, 0.0, 0.0)))


class _Pad:
    def __init__(self, name: str, taxels: Taxels, recogniser):
        self._name, self._taxels, self._pipeline = name, taxels, ContactPipeline(recogniser)
        self._sequence = 0

    def shape(self, values: np.ndarray, now: float) -> PadShape:
        status = np.where(np.isnan(values), TaxelStatus.STALE, TaxelStatus.VALID).astype(np.uint8)
        self._sequence += 1
        frame = PadFrame.of(TaxelFrame(EPOCH + now, self._sequence, values, status, 0), self._taxels,
                            f'{self._name}_pad')
        found = self._pipeline.find(frame.values, frame.taxels)
        contact = PadContact.of(frame, found)
        result = self._pipeline.recognise(contact.found, EPOCH + now)
        return PadShape.of(contact, result, 'learned', 0.0)


class PlannerChain:
    """Turns the frames of both pads into grasp messages. All times come from one steady clock [s]."""

    def __init__(self, finger_ends: SkinSide = NO_SIDE, gripper: Gripper = GRIPPER) -> None:
        recogniser = make_recogniser('learned', '')
        taxels = Taxels(PITCH, UNIT, finger_ends=finger_ends)
        self._pads = {side: _Pad(side, taxels, recogniser) for side in SIDES}
        self._gripper = gripper
        self._tracker = GraspTracker(GraspSettings(self._gripper))
        self._latest = {side: pad_shape_of(ContactShape()) for side in SIDES}
        self._times = dict.fromkeys(SIDES, -np.inf)

    def grasp(self, values: dict[str, np.ndarray], gap: float, now: float) -> Grasp:
        """Process one frame for each pad in ``values``, acquired at ``now``, and return the grasp DELAY later."""
        for side, frame in values.items():
            self._latest[side], self._times[side] = self._pads[side].shape(frame, now), now
            self._tracker.update(side, side_result(self._latest[side], now), now + DELAY)
        sent = now + DELAY
        message = grasp_message(CurrentGrasp(
            self._tracker.state(sent, gap), [self._latest[side] for side in SIDES],
            Opening(gap, GapSource.PARAMETER, 0.0), 'gripper', [sent - self._times[side] for side in SIDES],
            self._gripper))
        message.age = age_message(max(sent - self._times[side] for side in SIDES))
        return message
