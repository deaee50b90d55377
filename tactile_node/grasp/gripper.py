"""Where two opposing pads are: from a point on a pad to the gripper's frame, and the line between two."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError


@dataclass(frozen=True)
class PadPose:
    """A pad's frame in the gripper's when the gripper is closed (gap 0)."""

    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: origin: the centre of taxel (0, 0) [m]
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: roll, pitch, yaw, fixed axes (URDF, REP-103) [rad]
    rotation: np.ndarray = field(init=False, repr=False, compare=False)  #: (3, 3), columns are the pad's axes

    def __post_init__(self) -> None:
        if len(self.xyz) != 3 or len(self.rpy) != 3 or not np.isfinite((self.xyz, self.rpy)).all():
            raise ConfigurationError(
                'pose of a pad in the gripper frame', expected='three finite numbers each for xyz and rpy',
                got=f'{self.xyz}, {self.rpy}', remedy='Take both from the URDF.')
        (sr, sp, sy), (cr, cp, cy) = np.sin(self.rpy), np.cos(self.rpy)
        rotation = (np.array(((cy, -sy, 0), (sy, cy, 0), (0, 0, 1)))
                    @ np.array(((cp, 0, sp), (0, 1, 0), (-sp, 0, cp)))
                    @ np.array(((1, 0, 0), (0, cr, -sr), (0, sr, cr))))
        rotation.flags.writeable = False
        object.__setattr__(self, 'rotation', rotation)

    @property
    def normal(self) -> np.ndarray:
        """Out of the skin, towards what touches it; the closing direction of this pad."""
        return self.rotation[:, 2]

    def place(self, point: tuple[float, float], gap: float) -> np.ndarray:
        """Return a point (x, y) of the pad in the gripper's frame, shape (3,) [m], when opened by ``gap``."""
        return np.array(self.xyz) + self.rotation[:, :2] @ point - self.normal * (gap / 2)


@dataclass(frozen=True)
class Gripper:
    """Two pads that face each other; opening by a gap moves each back along its normal by half of it."""

    left: PadPose = PadPose()
    right: PadPose = PadPose(rpy=(np.pi, 0.0, 0.0))

    def __post_init__(self) -> None:
        if self.left.normal @ self.right.normal > -0.9:
            raise ConfigurationError(
                'poses of the pads', expected='pads that face each other (z axes opposed)',
                got=f'z axes {self.left.normal.round(3)} and {self.right.normal.round(3)}',
                remedy='Check the rpy of both; z points out of each skin.')

    @cached_property
    def closing(self) -> np.ndarray:
        """Unit vector from the left pad towards the right one."""
        direction = self.left.normal - self.right.normal
        unit: np.ndarray = direction / np.linalg.norm(direction)
        unit.flags.writeable = False
        return unit


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
