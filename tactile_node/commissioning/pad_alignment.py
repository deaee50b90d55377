"""Find how the two pads lie to each other, from blocks that lie freely between them."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tactile_node.commissioning.block_grip import MIRROR, BlockGrip
from tactile_node.commissioning.measurement import Estimate, mean_of

# Errors that all grips share, because the same taxels with the same gains lie under the blocks.
OFFSET_ERROR = 5e-5  #: [m]
TURN_ERROR = 2e-3    #: [rad]
TILT_ERROR = 8e-4    #: [rad]


class PadAlignment(NamedTuple):
    """Pose of the right pad, compared with a pad that faces the left one exactly.

    x and y are those of the left pad, seen with the fingertip up.
    """

    offset_x: Estimate  #: place of the right pad's centre [m]
    offset_y: Estimate
    turn: Estimate      #: turn of the right pad about the closing direction, from x to y of the left pad [rad]
    tilt_x: Estimate    #: change of the opening along x of the left pad [rad]
    tilt_y: Estimate    #: change of the opening along y of the left pad [rad]


def find_alignment(grips: Sequence[BlockGrip], metres: Sequence[float]) -> PadAlignment:
    """Return the mean alignment from several grips.

    Two directions share one deviation, because the spread of a few grips is uncertain.

    Parameters
    ----------
    grips : sequence of BlockGrip
        Grips of free blocks.
    metres : sequence of float
        Change of the opening per unit of the reading, with its sign, at each grip.
    """
    rows = np.array([(*_offset_and_turn(grip), *(-each * grip.slopes)) for grip, each in zip(grips, metres)])
    x, y, turn, tilt_x, tilt_y = (mean_of(column) for column in rows.T)
    offset, tilt = (math.hypot(one.deviation, other.deviation) / math.sqrt(2)
                    for one, other in ((x, y), (tilt_x, tilt_y)))
    return PadAlignment(*(Estimate(each.value, math.hypot(spread, error)) for each, spread, error in (
        (x, offset, OFFSET_ERROR), (y, offset, OFFSET_ERROR), (turn, turn.deviation, TURN_ERROR),
        (tilt_x, tilt, TILT_ERROR), (tilt_y, tilt, TILT_ERROR))))


def _offset_and_turn(grip: BlockGrip) -> tuple[float, float, float]:
    """Return the offset and the turn of the right pad, from the prints of the same block on both pads."""
    left, right = grip.prints
    turn = (left.angle + right.angle + np.pi / 2) % np.pi - np.pi / 2  # the angle on the right pad is mirrored
    x, y = left.centre - rotation_about(turn) @ MIRROR @ right.centre
    return float(x), float(y), float(turn)


def rotation_about(angle: float) -> np.ndarray:
    """Return the matrix that turns (x, y) by an angle [rad], (2, 2)."""
    return np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))
