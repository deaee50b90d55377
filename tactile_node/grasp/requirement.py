"""Requirements on a grasp, and a check that lists the parts of a requirement that a grasp does not meet."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from tactile_node.errors import RefusedRequirementError, RequirementRefusal
from tactile_node.grasp.gripper import Line
from tactile_node.grasp.tracker import GraspContact, GraspState
from tactile_node.shape.recognition import Shape

MOST_REQUIRED = 100  #: Largest number of shapes in one requirement. There are far fewer classes.
NO_SHAPES = ('', Shape.NONE.value, Shape.UNKNOWN.value)


class Missing(IntEnum):
    """Unmet part of a requirement. RequirementState.msg uses the same numbers."""

    NOT_KNOWN = 0        #: not evaluated
    NOTHING = 1
    NO_RESULT = 2   #: a side has no result yet
    UNSEEN = 3      #: a side is hidden, or its results are missing or too old
    NO_CONTACT = 4  #: nothing touches either pad, and both pads are seen
    ONE_SIDED = 5
    NOT_FRESH = 6  #: the acquisitions of both sides are too far apart in time
    BOUND = 7      #: a contact may extend beyond the seen area
    NOT_STABLE = 8
    HELD_TOO_SHORT = 9
    OTHER_SHAPE = 10
    UNSURE = 11  #: the confidence is lower than required, or the shape is unknown
    WIDTH_NOT_KNOWN = 12
    OTHER_WIDTH = 13
    OFFSET_NOT_KNOWN = 14
    OFFSET = 15
    MISALIGNMENT_NOT_KNOWN = 16
    MISALIGNED = 17


#: Code of the unmet part for each state of contact. TWO_SIDED is the required state and has no code.
CONTACT_MISSING = {GraspContact.NOT_KNOWN: Missing.NO_RESULT, GraspContact.UNSEEN: Missing.UNSEEN,
                   GraspContact.NO_CONTACT: Missing.NO_CONTACT, GraspContact.ONE_SIDED: Missing.ONE_SIDED}


class SideShape(NamedTuple):
    """The shape that one pad reports for its contact."""

    class_name: str
    confidence: float  #: probability of ``class_name``


@dataclass(frozen=True)
class Requirement:
    """Limits for a grasp, which must also be fresh, two-sided and stable. A limit of 0 has no effect.

    Raises
    ------
    RefusedRequirementError
        Raised if a limit is NaN, infinite or below 0, a confidence is above 1, or a shape cannot be required.
    """

    shapes: frozenset[str] = frozenset()  #: classes of which each side must report one; empty to accept any
    min_confidence: float = 0.0           #: smallest confidence that each side must have
    min_held: float = 0.0                 #: shortest time for which the grasp must have held [s]
    min_width: float = 0.0                #: smallest distance between the contacts [m]
    max_width: float = 0.0                #: largest distance between the contacts [m]
    max_offset: float = 0.0               #: largest offset of the contacts across the closing direction [m]
    max_misalignment: float = 0.0         #: largest angle between the line and the closing direction [rad]
    accepts_bound: bool = False           #: True to accept a contact that may extend beyond the seen area

    def __post_init__(self) -> None:
        limits = {name: getattr(self, name) for name in
                  ('min_confidence', 'min_held', 'min_width', 'max_width', 'max_offset', 'max_misalignment')}
        for name, limit in limits.items():
            if not 0 <= limit < math.inf or name == 'min_confidence' and limit > 1:
                raise _refused(RequirementRefusal.NOT_A_LIMIT, 'a number of 0 or more, a confidence of at most 1',
                               f'{name} {limit}', 'Leave it 0 for no limit.')
        if 0 < self.max_width < self.min_width:
            raise _refused(RequirementRefusal.EMPTY_RANGE, 'min_width up to max_width',
                           f'{self.min_width} and {self.max_width}', 'Leave max_width 0 for no limit.')
        if len(self.shapes) > MOST_REQUIRED:
            raise _refused(RequirementRefusal.TOO_MANY_SHAPES, f'at most {MOST_REQUIRED} shapes', f'{len(self.shapes)}',
                           'Leave them empty for any shape.')
        for name in self.shapes & set(NO_SHAPES):
            raise _refused(RequirementRefusal.NO_SUCH_SHAPE, 'shapes that can be held', repr(name),
                           'Leave them empty for any shape.')


def missing(requirement: Requirement, state: GraspState, sides: tuple[SideShape, SideShape]) -> tuple[Missing, ...]:
    """Return the unmet parts of a requirement in the order of `Missing`, or () if all parts are met.

    Parameters
    ----------
    requirement : Requirement
        The requirement.
    state : GraspState
        State of the grasp at one time.
    sides : tuple of SideShape
        Shapes reported by the left and the right pad.

    Examples
    --------
    >>> from tactile_node.grasp.tracker import GraspTracker
    >>> nothing = SideShape('none', 1.0)
    >>> [each.name for each in missing(Requirement(), GraspTracker().state(0.0), (nothing, nothing))]
    ['NO_RESULT']
    """
    if state.contact in CONTACT_MISSING:
        return (CONTACT_MISSING[state.contact],)
    if not state.fresh:
        return (Missing.NOT_FRESH,)
    return (*_not_held(requirement, state), *_wrong_shape(requirement, sides), *_wrong_line(requirement, state.line))


def _not_held(requirement: Requirement, state: GraspState) -> Iterator[Missing]:
    if state.line_is_bound and not requirement.accepts_bound:
        yield Missing.BOUND
    if not state.stable:
        yield Missing.NOT_STABLE
    if not state.held >= requirement.min_held:
        yield Missing.HELD_TOO_SHORT


def _wrong_shape(requirement: Requirement, sides: tuple[SideShape, SideShape]) -> Iterator[Missing]:
    if requirement.shapes and not all(side.class_name in requirement.shapes for side in sides):
        yield Missing.OTHER_SHAPE
    if requirement.min_confidence and not all(
            side.class_name not in NO_SHAPES and side.confidence >= requirement.min_confidence for side in sides):
        yield Missing.UNSURE


def _wrong_line(requirement: Requirement, line: Line | None) -> Iterator[Missing]:
    """Yield the code of each limit that the line between the contacts does not meet.

    An unknown value neither meets nor violates a limit, so unknown values have their own codes.
    """
    width, offset, misalignment = (line.width, line.offset, line.misalignment) if line else (math.nan,) * 3
    for value, least, most, not_known, wrong in (
            (width, requirement.min_width, requirement.max_width, Missing.WIDTH_NOT_KNOWN, Missing.OTHER_WIDTH),
            (offset, 0.0, requirement.max_offset, Missing.OFFSET_NOT_KNOWN, Missing.OFFSET),
            (misalignment, 0.0, requirement.max_misalignment, Missing.MISALIGNMENT_NOT_KNOWN, Missing.MISALIGNED)):
        if not least and not most:
            continue
        if not math.isfinite(value):
            yield not_known
        elif not least <= value <= (most or math.inf):
            yield wrong


def _refused(refusal: RequirementRefusal, expected: str, got: str, remedy: str) -> RefusedRequirementError:
    return RefusedRequirementError('requirement of a grasp', refusal, expected=expected, got=got, remedy=remedy)
