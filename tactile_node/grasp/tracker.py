"""The results of two opposing pads, as they arrive, as one grasp: what is held, how straight, for how long."""

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError, InputError
from tactile_node.grasp.gripper import Gripper
from tactile_node.shape.recognition import Shape

SIDES = ('left', 'right')


class SideResult(NamedTuple):
    """The result of one pad at one time; ``centre`` None when nothing touches it."""

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
        """Both sides report the same, and it is one of the five shapes."""
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
    """Takes the sides' results in any order; pure: time is given by the stamps alone."""

    def __init__(self, settings: GraspSettings = GraspSettings()):
        self._settings = settings
        self._latest: dict[str, SideResult | None] = dict.fromkeys(SIDES)
        self._anchors: dict[str, SideResult | None] = dict.fromkeys(SIDES)

    def update(self, side: str, result: SideResult, gap: float = 0.0) -> GraspState:
        """Take ``result`` of ``side`` ("left" or "right") at an opening of ``gap`` [m] and return the grasp.

        A result older than the side's latest starts that side again: its clock was set back. Raises
        ConfigurationError for another side, InputError for a stamp or a centre that is not finite.
        """
        if side not in SIDES:
            raise ConfigurationError('side of a grasp', expected=' or '.join(SIDES), got=repr(side),
                                     remedy='Name the pads by side.')
        if not np.isfinite((result.stamp, *(result.centre or ()))).all():
            raise InputError('result of a side', expected='a finite stamp and centre',
                             got=f'{result.stamp}, {result.centre}', remedy='Give centre None where nothing touches.')
        self._anchor(side, result)
        self._latest[side] = result
        return self._state(gap)

    def _anchor(self, side: str, result: SideResult) -> None:
        """Keep the result since which this side has held: another shape, a slip or a silence starts it again."""
        anchor, before = self._anchors[side], self._latest[side]
        if result.centre is None:
            self._anchors[side] = None
        elif (anchor is None or anchor.centre is None or before is None or result.shape is not anchor.shape
              or not 0 <= result.stamp - before.stamp <= self._settings.max_skew
              or np.hypot(*np.subtract(result.centre, anchor.centre)) > self._settings.centre_tolerance):
            self._anchors[side] = result

    def _state(self, gap: float) -> GraspState:
        left, right = (self._latest[side] for side in SIDES)
        known = [side for side in (left, right) if side is not None]
        centres = [side.centre for side in known if side.centre is not None]
        fresh = left is not None and right is not None and abs(left.stamp - right.stamp) <= self._settings.max_skew
        state = GraspState(stamp=max(side.stamp for side in known), sides=(left, right),
                           contact=GraspContact(len(centres)), fresh=fresh, line=None, held=0.0, stable=False)
        if state.contact is not GraspContact.TWO_SIDED or not fresh:
            return state
        began = max(anchor.stamp for anchor in self._anchors.values() if anchor is not None)
        held = max(0.0, min(side.stamp for side in known) - began)
        line = self._line(centres[0], centres[1], gap)
        return state._replace(line=line, held=held, stable=held >= self._settings.min_hold)

    def _line(self, left_centre: tuple[float, float], right_centre: tuple[float, float], gap: float) -> Line:
        gripper = self._settings.gripper
        left, right = gripper.left.place(left_centre, gap), gripper.right.place(right_centre, gap)
        across = right - left
        along = float(across @ gripper.closing)
        offset = float(np.linalg.norm(across - along * gripper.closing))
        return Line(left=left, right=right, width=float(np.linalg.norm(across)), offset=offset,
                    misalignment=float(np.arctan2(offset, along)))
