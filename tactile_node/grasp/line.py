"""The line between the contacts on two opposing pads."""

from typing import NamedTuple

import numpy as np

from tactile_node.grasp.gripper import Gripper

Point = tuple[float, float]  # of a pad, in its own frame [m]


class Line(NamedTuple):
    """From the left contact's centre to the right one's, in the gripper's frame.

    All but ``offset`` are NaN while the opening is not known: they depend on it.
    """

    left: np.ndarray       #: (3,) [m]
    right: np.ndarray      #: (3,) [m]
    width: float           #: its length [m]
    offset: float          #: distance of the two centres across the closing direction [m]
    misalignment: float    #: angle between the line and the closing direction [rad]

    @property
    def midpoint(self) -> np.ndarray:
        middle: np.ndarray = (self.left + self.right) / 2
        return middle

    @property
    def axis(self) -> np.ndarray:
        """Unit vector from left to right; NaN when both are one point."""
        return (self.right - self.left) / self.width if self.width else np.full(3, np.nan)


def contact_line(gripper: Gripper, left_centre: Point, right_centre: Point, gap: float) -> Line:
    """Return the line between two contacts of a gripper that is open by ``gap`` [m], NaN: not known.

    The offset does not depend on the opening: each pad moves along its own normal, and both together change the
    distance along the closing direction alone.
    """
    left, right = gripper.left.place(left_centre, 0.0), gripper.right.place(right_centre, 0.0)
    closing = gripper.closing
    closed = right - left
    offset = float(np.linalg.norm(closed - closed @ closing * closing))
    left = left - gripper.left.normal * (gap / 2)
    right = right - gripper.right.normal * (gap / 2)
    across = right - left
    along = float(across @ closing)
    return Line(left=left, right=right, width=float(np.linalg.norm(across)), offset=offset,
                misalignment=float(np.arctan2(offset, along)))
