"""Grasps as messages, the sides they are made of, and what a grasp has to be."""

import math
from collections.abc import Collection, Sequence
from copy import copy
from functools import cache

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Vector3
from std_msgs.msg import Header

from tactile_node.errors import RefusedRequirementError, RequirementRefusal
from tactile_node.grasp.gripper import Line
from tactile_node.grasp.opening import Opening
from tactile_node.grasp.requirement import MOST_REQUIRED, Missing, Requirement
from tactile_node.grasp.steadiness import FIT_RESOLUTION, PATTERN_RESOLUTION, PRESSURE_RESOLUTION
from tactile_node.grasp.tracker import GraspState, SideResult, SideState
from tactile_node.ros.message_age import age_message
from tactile_node.ros.shape_messages import SHAPE_OF_NUMBER
from tactile_node.ros.time_messages import duration_message, seconds
from tactile_node.shape.recognition import SHAPES
from tactile_skin.msg import ContactShape, Grasp, GraspRequirement, RequirementState

MOST_HIDDEN = 0.25  #: fraction of a contact or of the ring around it; 3 % of dead taxels hide less
#: code -> name, of the shapes that a requirement may ask for
REQUIRABLE = {code: shape.value for code, shape in SHAPE_OF_NUMBER.items() if shape in SHAPES}
LONGEST = 3600.0  #: s, timeout of a goal; a longer one is taken for a mistake
NANOSECONDS = 10**9


def side_result(message: ContactShape, time: float) -> SideResult:
    """What one pad reports; ``time`` [s]: of its acquisition, on our clock."""
    is_hidden = _is_largely_hidden(message)
    place, resolution, is_bound = _of_fit(message) if message.fit_valid else _of_pressure(message)
    if not (message.taxels and message.contacts and math.isfinite(place.x) and math.isfinite(place.y)):
        return SideResult(time, _reported_state(message), message.class_name, hides_creep=is_hidden)
    return SideResult(time, _reported_state(message), message.class_name, (place.x, place.y), resolution,
                      is_bound=is_bound or is_hidden, hides_creep=is_hidden)


def _reported_state(message: ContactShape) -> SideState:
    """EMPTY only what says so: NONE of a pad that was seen."""
    if message.taxels or message.contacts:
        return SideState.TOUCHED
    return SideState.EMPTY if message.shape == ContactShape.NONE and message.pad_seen else SideState.UNSEEN


def _is_largely_hidden(message: ContactShape) -> bool:
    """Whether the object may be another one than what is seen of it: at the pad's edge, or under many hidden taxels.

    A few of them, scattered, neither cut an edge off nor hide that it moves.
    """
    return (message.at_edge or message.hidden_ring_taxels > MOST_HIDDEN * message.ring_taxels
            or message.hidden_taxels > MOST_HIDDEN * message.taxels
            or message.size_is_bound and not message.saturated_taxels)


def _of_fit(message: ContactShape) -> tuple[Point, float, bool]:
    """The centre, its resolution [m], and whether it is a bound: then it is that of the part that is seen."""
    of_values = PATTERN_RESOLUTION if math.isnan(message.force) else FIT_RESOLUTION
    uncertain = 2 * max(message.standard_deviations[:2], default=0.0)
    return message.pose.pose.position, max(of_values * _pitch(message), uncertain), message.size_is_bound


def _of_pressure(message: ContactShape) -> tuple[Point, float, bool]:
    """Return the centre of pressure like `_of_fit`; saturation shifts it, and so does every hidden taxel at the rim."""
    of_values = PATTERN_RESOLUTION if math.isnan(message.force) else PRESSURE_RESOLUTION
    return message.centre_of_pressure, of_values * _pitch(message), message.centre_of_pressure_is_bound


def _pitch(message: ContactShape) -> float:
    """Return the pitch of the pad [m]; 0 without a contact."""
    return math.sqrt(message.contact_areas[0] / message.taxels) if message.taxels and message.contacts else 0.0


def grasp_message(state: GraspState, sides: list[ContactShape], opening: Opening, frame_id: str,
                  ages: Sequence[float]) -> Grasp:
    """``sides``: the latest message of the left and the right pad; ``ages`` of both [s], inf: not known.

    Stamp and age are those of the older one: a receiver measures the delay of its path by both together.
    """
    words = state.contact.name, 'fresh' if state.fresh else 'not fresh', 'stable' if state.stable else 'not stable'
    fields = dict(
        header=Header(stamp=_older(sides, ages).header.stamp, frame_id=frame_id), message=', '.join(words),
        age=age_message(max(ages)), sides=sides,
        side_states=[int(each) for each in state.side_states], contact=int(state.contact), fresh=state.fresh,
        gap=opening.gap, gap_source=int(opening.source), gap_age=age_message(opening.age), same_shape=state.same_shape,
        stable=state.stable, held=duration_message(state.held), creep=state.creep, line_is_bound=state.line_is_bound)
    message = copy(_blank())
    for name, value in fields.items():
        setattr(message, name, value)
    _add_line(message, state.line)
    return message


@cache
def _blank() -> Grasp:
    """A message to copy: the constructor makes both sides, for others to take their place."""
    return Grasp()


def _older(sides: list[ContactShape], ages: Sequence[float]) -> ContactShape:
    """Return the side of the greater age; one that has no message yet only where neither has."""
    by_age = sorted(zip(ages, sides), key=lambda each: each[0], reverse=True)
    received = [side for _, side in by_age if side.header.stamp.sec or side.header.stamp.nanosec]
    return received[0] if received else by_age[0][1]


def _add_line(message: Grasp, line: Line | None) -> None:
    nowhere = np.full(3, np.nan)
    left, right, middle, axis = (line.left, line.right, line.midpoint, line.axis) if line else (nowhere,) * 4
    message.left_centre = _point(left)
    message.right_centre = _point(right)
    message.midpoint = _point(middle)
    message.axis = Vector3(x=float(axis[0]), y=float(axis[1]), z=float(axis[2]))
    message.width = line.width if line else math.nan
    message.offset = line.offset if line else math.nan
    message.misalignment = line.misalignment if line else math.nan


def _point(place: np.ndarray) -> Point:
    return Point(x=float(place[0]), y=float(place[1]), z=float(place[2]))


def requirement_of(message: GraspRequirement, known_names: Collection[str] = ()) -> Requirement:
    """Return what ``message`` asks for; ``known_names``: of the classes there are, empty: not known.

    Raises RefusedRequirementError for a limit that is none, and for a shape that no recogniser reports, for which a
    goal would wait in vain.
    """
    if len(message.shapes) + len(message.class_names) > 2 * MOST_REQUIRED:  # before anything is made of them
        raise _refused(RequirementRefusal.TOO_MANY_SHAPES, f'at most {MOST_REQUIRED} shapes',
                       f'{len(message.shapes)} codes and {len(message.class_names)} names')
    shapes = frozenset((*map(_name, message.shapes), *message.class_names))
    requirement = Requirement(
        shapes=shapes, min_confidence=message.min_confidence, min_held=_duration(message.min_held, 'min_held'),
        min_width=message.min_width, max_width=message.max_width, max_offset=message.max_offset,
        max_misalignment=message.max_misalignment, accepts_bound=message.accept_bound)
    if known_names and not shapes <= set(known_names):
        raise _refused(RequirementRefusal.NO_SUCH_SHAPE, f'names of {", ".join(known_names)}',
                       ', '.join(sorted(shapes - set(known_names))))
    return requirement


def timeout_of(message: Duration) -> float:
    """Return the timeout of a goal [s]. Raises RefusedRequirementError for 0, below 0 or longer than LONGEST."""
    timeout = _duration(message, 'timeout')
    if not 0 < timeout <= LONGEST:
        raise _refused(RequirementRefusal.NO_TIMEOUT, f'a timeout above 0 s, at most {LONGEST:g} s', f'{timeout:g} s')
    return timeout


def state_message(found: Sequence[Missing]) -> RequirementState:
    """``found``: as of `missing`."""
    return RequirementState(missing=int(found[0] if found else Missing.NOTHING),
                            all_missing=[int(each) for each in found])


def _name(code: int) -> str:
    if code not in REQUIRABLE:
        raise _refused(RequirementRefusal.NO_SUCH_SHAPE, f'codes {", ".join(map(str, REQUIRABLE))}', str(code))
    return REQUIRABLE[code]


def _duration(message: Duration, name: str) -> float:
    if message.sec < 0 or message.nanosec >= NANOSECONDS:
        raise _refused(RequirementRefusal.NOT_A_LIMIT, 'a duration from 0 s on, with less than 10^9 ns',
                       f'{name} {message.sec} s {message.nanosec} ns')
    return seconds(message)


def _refused(refusal: RequirementRefusal, expected: str, got: str) -> RefusedRequirementError:
    return RefusedRequirementError('requirement of a grasp', refusal, expected=expected, got=got,
                                   remedy='See GraspRequirement.msg.')
