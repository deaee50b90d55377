"""Geometry of two opposing pads: convert points to the gripper frame, and find the line between two contacts."""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.taxel_frame import read_only


def rotation_matrix(x: float, y: float, z: float, w: float) -> np.ndarray:
    """Return the rotation matrix, (3, 3), of a quaternion of any non-zero length."""
    x, y, z, w = np.array((x, y, z, w)) / math.hypot(x, y, z, w)
    return np.array(((1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
                     (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
                     (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y))))


@dataclass(frozen=True)
class PadPose:
    """Pose of a pad frame in the gripper frame while the gripper is closed (gap 0).

    Raises
    ------
    ConfigurationError
        Raised if ``xyz`` or ``rpy`` does not consist of three finite numbers.
    """

    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: origin of the pad frame: the centre of taxel (0, 0) [m]
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: roll, pitch and yaw about fixed axes (URDF, REP-103) [rad]
    rotation: np.ndarray = field(init=False, repr=False, compare=False)  #: axes of the pad as columns, (3, 3)
    origin: np.ndarray = field(init=False, repr=False, compare=False)  #: ``xyz`` as an array, (3,) [m]

    def __post_init__(self) -> None:
        if len(self.xyz) != 3 or len(self.rpy) != 3 or not np.isfinite((self.xyz, self.rpy)).all():
            raise ConfigurationError(
                'pose of a pad in the gripper frame', expected='three finite numbers each for xyz and rpy',
                got=f'{self.xyz}, {self.rpy}', remedy='Take xyz and rpy from the URDF.')
        (sr, sp, sy), (cr, cp, cy) = np.sin(self.rpy), np.cos(self.rpy)
        rotation = (np.array(((cy, -sy, 0), (sy, cy, 0), (0, 0, 1)))
                    @ np.array(((cp, 0, sp), (0, 1, 0), (-sp, 0, cp)))
                    @ np.array(((1, 0, 0), (0, cr, -sr), (0, sr, cr))))
        object.__setattr__(self, 'rotation', read_only(rotation))
        object.__setattr__(self, 'origin', read_only(np.array(self.xyz, float)))

    @property
    def normal(self) -> np.ndarray:
        """Unit vector that points out of the skin, in the direction in which the pad closes."""
        return self.rotation[:, 2]

    def place(self, point: tuple[float, float], gap: float) -> np.ndarray:
        """Convert a point on the pad to the gripper frame, (3,) [m].

        Parameters
        ----------
        point : tuple of float
            Point (x, y) in the pad frame [m].
        gap : float
            Opening of the gripper [m].
        """
        return self.origin + self.rotation[:, :2] @ point - self.normal * (gap / 2)


@dataclass(frozen=True)
class Gripper:
    """Two pads that face each other.

    When the gripper opens by a gap, each pad moves back along its normal by half the gap.

    Raises
    ------
    ConfigurationError
        Raised if the pads do not face each other.
    """

    left: PadPose = PadPose()
    right: PadPose = PadPose(rpy=(np.pi, 0.0, 0.0))

    def __post_init__(self) -> None:
        if self.left.normal @ self.right.normal > -0.9:
            raise ConfigurationError(
                'poses of the pads', expected='pads that face each other (z axes opposed)',
                got=f'z axes {self.left.normal.round(3)} and {self.right.normal.round(3)}',
                remedy='Check the rpy of both pads. The z axis of each pad points out of its skin.')

    @cached_property
    def closing(self) -> np.ndarray:
        """Unit vector from the left pad towards the right pad."""
        direction = self.left.normal - self.right.normal
        return read_only(direction / np.linalg.norm(direction))

    @cached_property
    def across(self) -> np.ndarray:
        """Unit vectors across the closing direction, along the left pad's x and y axes, (2, 3)."""
        x = self.left.rotation[:, 0] - self.left.rotation[:, 0] @ self.closing * self.closing
        x /= np.linalg.norm(x)
        return read_only(np.array((x, np.cross(self.closing, x))))


Point = tuple[float, float]  # (x, y) on a pad, in the frame of the pad [m]


class Line(NamedTuple):
    """The line from the centre of the left contact to the centre of the right contact, in the gripper frame.

    All fields except ``offset`` depend on the opening, and are NaN while the opening is unknown.
    """

    left: np.ndarray     #: centre of the left contact, (3,) [m]
    right: np.ndarray    #: centre of the right contact, (3,) [m]
    width: float         #: length of the line [m]
    offset: float        #: distance between the two centres across the closing direction [m]
    misalignment: float  #: angle between the line and the closing direction [rad]

    @property
    def midpoint(self) -> np.ndarray:
        return (self.left + self.right) / 2

    @property
    def axis(self) -> np.ndarray:
        """Unit vector from the left centre to the right centre, or NaN if both centres coincide."""
        return (self.right - self.left) / self.width if self.width else np.full(3, np.nan)


def contact_line(gripper: Gripper, left_centre: Point, right_centre: Point, gap: float) -> Line:
    """Return the line between the contacts of both pads.

    The offset does not depend on the opening. Each pad moves along its own normal, so opening the gripper changes only
    the distance along the closing direction.

    Parameters
    ----------
    gripper : Gripper
        Poses of the pads.
    left_centre, right_centre : tuple of float
        Centre of each contact in the frame of its pad [m].
    gap : float
        Opening of the gripper [m], or NaN if unknown.
    """
    left, right = gripper.left.place(left_centre, 0.0), gripper.right.place(right_centre, 0.0)
    closing = gripper.closing
    closed = right - left
    sideways = closed - closed @ closing * closing
    offset = math.sqrt(sideways @ sideways)
    left = left - gripper.left.normal * (gap / 2)
    right = right - gripper.right.normal * (gap / 2)
    across = right - left
    along = float(across @ closing)
    return Line(left=left, right=right, width=math.sqrt(across @ across), offset=offset,
                misalignment=float(np.arctan2(offset, along)))
