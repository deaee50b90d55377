"""Find where the pads are on the gripper, from a block that stands in a jig on the palm.

The jig holds the block at a known pose in the frame of the gripper. The block may slide along the closing direction, so
that both pads press equally. The axes of the jig are those of the gripper if z points from the palm to the fingertips,
and y from the left to the right pad. The longer side of the face of the block lies along x.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tactile_node.commissioning.block_grip import MIRROR, BlockFace
from tactile_node.commissioning.measurement import Estimate
from tactile_node.commissioning.mistake import Mistake, RefusedStepError
from tactile_node.commissioning.pad_alignment import TILT_ERROR, PadAlignment, rotation_about
from tactile_node.grasp.frame_tree import Transform
from tactile_node.grasp.gripper import PadPose

MOST_SKEW = 0.25     #: Largest difference between the slopes of the block against the two pads [rad].
MOST_TURN = 0.1      #: Largest angle between the block and a pad about the closing direction [rad].
JIG_ERROR = 1e-4     #: Deviation of the place of the block in the jig: half the tolerance of the drawing [m].
JIG_TURN = 3.3e-3    #: Deviation of each angle of this block, which the jig guides over 30 mm [rad].
CENTRE_ERROR = 6e-5  #: Deviation of the place of the block on the pads [m].
TURN_ERROR = 5.6e-3  #: Deviation of the turn of the block on the pads [rad].
#: Axes of a left pad without an error in the axes of the jig, as columns.
ALIGNED = np.array(((-1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)))


class PadPlace(NamedTuple):
    """Pose of the left skin of the closed gripper in the frame of the gripper."""

    x: Estimate       #: centre of the skin [m]
    y: Estimate
    z: Estimate
    turn: Estimate    #: turn against the jig about the closing direction [rad]
    tilt_x: Estimate  #: change of the distance to the block along x of the pad, seen with the fingertip up [rad]
    tilt_y: Estimate

    def pose(self, jig: Sequence[float]) -> Transform:
        """Return the pose of the skin seen with the fingertip up, for the pose of the jig as in `place_left_pad`."""
        tilted = PadPose(rpy=(-self.tilt_y.value, self.tilt_x.value, self.turn.value)).rotation
        return Transform(_axes(jig) @ tilted, np.array((self.x.value, self.y.value, self.z.value)))


def check_jig(faces: Sequence[BlockFace]) -> None:
    """Raise RefusedStepError if the block is turned in the jig."""
    turn = max(abs(face.angle) for face in faces)
    if turn > MOST_TURN:
        raise RefusedStepError('jig', Mistake.BLOCK_ASKEW, expected='a block whose longer side lies across the finger',
                               got=f'a turn by {math.degrees(turn):.0f} degrees', remedy='Hold the jig with its datum '
                               'faces against the palm, with the block in its groove.')


def place_left_pad(faces: tuple[BlockFace, BlockFace], metres: float, alignment: PadAlignment, jig: Sequence[float]
                   ) -> PadPlace:
    """Return the place of the left pad.

    Parameters
    ----------
    faces : tuple of BlockFace
        Faces of the block on the left and the right pad.
    metres : float
        Change of the opening per unit of the reading, with its sign, at the width of the block.
    alignment : PadAlignment
        Pose of the right pad, by which the right pad shows the place of the block on the left one.
    jig : sequence of float
        Pose of the block in the jig in the frame of the gripper: x, y, z [m], roll, pitch, yaw [rad].
    """
    left, right = faces
    offset_x, offset_y, turn, *tilt = (each.value for each in alignment)
    across = rotation_about(turn) @ MIRROR
    centre = (left.centre + across @ right.centre + (offset_x, offset_y)) / 2
    angle = (left.angle + turn - right.angle) / 2
    tilt_x, tilt_y = (tilt + metres / 2 * (across @ right.slopes - left.slopes)) / 2
    place = _axes(jig) @ (*(-rotation_about(-angle) @ centre), 0.0) + jig[:3]
    x, y, z = (Estimate(float(each), math.hypot(JIG_ERROR, CENTRE_ERROR)) for each in place)
    return PadPlace(x, y, z, Estimate(-angle, math.hypot(JIG_TURN, TURN_ERROR)),
                    *(Estimate(float(each), math.hypot(JIG_TURN, TILT_ERROR)) for each in (tilt_x, tilt_y)))


def _axes(jig: Sequence[float]) -> np.ndarray:
    roll, pitch, yaw = jig[3:]
    return PadPose(rpy=(roll, pitch, yaw)).rotation @ ALIGNED
