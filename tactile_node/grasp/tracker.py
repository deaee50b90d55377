"""The results of two opposing pads, as they come, as one grasp: what is held, how straight, for how long."""

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.grasp.gripper import Gripper
from tactile_node.shape.recognition import Shape

SIDES = ('left', 'right')


class SideResult(NamedTuple):
    """What one pad says at one time; ``centre`` None when nothing touches it."""

    stamp: float                         #: acquisition [s]
    shape: Shape
    centre: tuple[float, float] | None   #: of the contact, in the pad's frame [m]


class GraspContact(IntEnum):
    """Which pads are touched (Grasp.msg mirrors these numbers)."""

    NO_CONTACT = 0
    ONE_SIDED = 1
    TWO_SIDED = 2


class Line(NamedTuple):
    """From the left contact's centre to the right one's, in the gripper's frame."""

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


class GraspState(NamedTuple):
    """Of both pads at ``stamp``, the later of the two."""

    stamp: float
    sides: tuple[SideResult | None, SideResult | None]  #: left, right; None: nothing received yet
    contact: GraspContact
    fresh: bool         #: both sides are known, and of nearly one time
    line: Line | None   #: None unless TWO_SIDED and fresh
    held: float         #: for how long shapes and centres of both sides have held [s]
    stable: bool        #: two-sided, fresh, and held long enough

    @property
    def same_shape(self) -> bool:
        """Both sides say the same, and it is one of the five shapes."""
        left, right = (side.shape if side else Shape.NONE for side in self.sides)
        return left is right and left not in (Shape.NONE, Shape.UNKNOWN)


@dataclass(frozen=True)
class GraspSettings:
    """When a grasp counts as stable."""

    gripper: Gripper = Gripper()
    centre_tolerance: float = 0.001  #: how far a centre may move from where it was when the grasp began [m]
    min_hold: float = 0.2            #: [s]
    max_skew: float = 0.1            #: how far the two sides' stamps may be apart [s]

    def __post_init__(self) -> None:
        if not (0 < self.centre_tolerance < np.inf and 0 < self.max_skew < np.inf and 0 <= self.min_hold):
            raise ConfigurationError(
                'grasp settings', expected='centre_tolerance and max_skew > 0, min_hold >= 0',
                got=str(self), remedy='Give metres and seconds.')


class GraspTracker:
    """Takes the sides' results in any order; pure: time is only what the stamps say."""

    def __init__(self, settings: GraspSettings = GraspSettings()):
        self._settings = settings
        self._latest: dict[str, SideResult | None] = dict.fromkeys(SIDES)
        self._anchors: dict[str, SideResult | None] = dict.fromkeys(SIDES)

    def update(self, side: str, result: SideResult, gap: float = 0.0) -> GraspState:
        """Take ``result`` of ``side`` ("left" or "right") at an opening of ``gap`` [m] and return the grasp.

        A result older than the side's latest starts that side anew: its clock was set back. Raises
        ConfigurationError for another side.
        """
        if side not in SIDES:
            raise ConfigurationError('side of a grasp', expected=' or '.join(SIDES), got=repr(side),
                                     remedy='Name the pads by side.')
        self._anchor(side, result)
        self._latest[side] = result
        return self._state(gap)

    def _anchor(self, side: str, result: SideResult) -> None:
        """Keep the result since which this side has held: another shape, a slip or a silence begins anew."""
        anchor, before = self._anchors[side], self._latest[side]
        if result.centre is None:
            self._anchors[side] = None
        elif (anchor is None or result.shape is not anchor.shape
              or not 0 <= result.stamp - before.stamp <= self._settings.max_skew
              or np.hypot(*np.subtract(result.centre, anchor.centre)) > self._settings.centre_tolerance):
            self._anchors[side] = result

    def _state(self, gap: float) -> GraspState:
        sides = tuple(self._latest[side] for side in SIDES)
        known = [side for side in sides if side is not None]
        stamp = max(side.stamp for side in known)
        contact = GraspContact(sum(side.centre is not None for side in known))
        fresh = len(known) == 2 and abs(sides[0].stamp - sides[1].stamp) <= self._settings.max_skew
        if contact is not GraspContact.TWO_SIDED or not fresh:
            return GraspState(stamp, sides, contact, fresh, None, 0.0, False)
        held = max(0.0, min(side.stamp for side in sides) - max(self._anchors[side].stamp for side in SIDES))
        stable = held >= self._settings.min_hold
        return GraspState(stamp, sides, contact, fresh, self._line(sides, gap), held, stable)

    def _line(self, sides: tuple[SideResult, SideResult], gap: float) -> Line:
        gripper = self._settings.gripper
        left, right = gripper.left.place(sides[0].centre, gap), gripper.right.place(sides[1].centre, gap)
        across = right - left
        along = float(across @ gripper.closing)
        offset = float(np.linalg.norm(across - along * gripper.closing))
        return Line(left, right, float(np.linalg.norm(across)), offset, float(np.arctan2(offset, along)))
