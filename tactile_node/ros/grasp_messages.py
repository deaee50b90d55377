"""Convert grasps and the results of both pads to messages."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from std_msgs.msg import Header

from tactile_node.grasp.gripper import Gripper, Line
from tactile_node.grasp.held_object import Face, FaceFit, HeldObject, held_object
from tactile_node.grasp.opening import Opening
from tactile_node.grasp.steadiness import FIT_RESOLUTION, PATTERN_RESOLUTION, PRESSURE_RESOLUTION
from tactile_node.grasp.tracker import GraspContact, GraspState, SideResult, SideState
from tactile_node.ros.contact_messages import single
from tactile_node.ros.message_age import age_message
from tactile_node.ros.motion_messages import current_motion, is_moving
from tactile_node.ros.shape_messages import PadShape, number_of
from tactile_node.ros.time_messages import duration_message
from tactile_skin.msg import ContactShape, Grasp, GraspSides

#: Fraction of hidden taxels, in a contact or in the ring around the contact, above which the contact counts as largely
#: hidden. A pad with 3 % dead taxels stays below this fraction.
MOST_HIDDEN = 0.25


class CurrentGrasp(NamedTuple):
    """The grasp at one moment, with everything that its messages state."""

    state: GraspState           #: state that the grasp tracker reports
    sides: Sequence[PadShape]   #: latest shapes on the left and the right pad
    opening: Opening            #: opening of the gripper
    frame_id: str               #: frame of the gripper
    ages: Sequence[float]       #: ages of the two shapes [s]; inf if not known
    gripper: Gripper            #: geometry of the gripper


def side_result(shape: PadShape, time: float) -> SideResult:
    """Return the result of one pad that was acquired at ``time`` on this host's clock [s]."""
    is_hidden, centre, moves = _is_largely_hidden(shape), _centre(shape), is_moving(shape.motion)
    if centre is None:
        return SideResult(time, _reported_state(shape), shape.class_name, hides_creep=is_hidden, moves=moves)
    resolution, is_bound = _of_pressure(shape) if shape.centre is None else _of_fit(shape)
    return SideResult(time, _reported_state(shape), shape.class_name, centre, resolution,
                      is_bound=is_bound or is_hidden, hides_creep=is_hidden, moves=moves)


def _centre(shape: PadShape) -> tuple[float, float] | None:
    """Return the centre of the fit or, without a fit, the centre of pressure. None means that no centre is known."""
    place = shape.centre_of_pressure if shape.centre is None else shape.centre
    return place if shape.taxels and shape.contacts and all(map(math.isfinite, place)) else None


def _reported_state(shape: PadShape) -> SideState:
    """Return the state that the pad reports. The state is EMPTY only if the shape is NONE and the pad was seen."""
    if shape.taxels or shape.contacts:
        return SideState.TOUCHED
    return SideState.EMPTY if shape.shape == ContactShape.NONE and shape.pad_seen else SideState.UNSEEN


def _is_largely_hidden(shape: PadShape) -> bool:
    """Return True if the contact may differ from its visible part, at the pad's edge or under many hidden taxels.

    A few scattered hidden taxels neither cut off an edge nor hide a motion.
    """
    return (shape.at_edge or shape.hidden_ring_taxels > MOST_HIDDEN * shape.ring_taxels
            or shape.hidden_taxels > MOST_HIDDEN * shape.taxels
            or shape.size_is_bound and not shape.saturated_taxels)


def _of_fit(shape: PadShape) -> tuple[float, bool]:
    """Return the resolution of the fitted centre [m], and True if the fit describes only the visible part."""
    of_values = PATTERN_RESOLUTION if math.isnan(shape.force) else FIT_RESOLUTION
    uncertain = 2 * max(shape.standard_deviations[:2], default=0.0)
    return max(of_values * shape.pitch, uncertain), shape.size_is_bound


def _of_pressure(shape: PadShape) -> tuple[float, bool]:
    """Return the resolution of the centre of pressure [m], and True if hidden or saturated taxels may shift it."""
    of_values = PATTERN_RESOLUTION if math.isnan(shape.force) else PRESSURE_RESOLUTION
    return of_values * shape.pitch, shape.centre_of_pressure_is_bound


def face_of(shape: PadShape) -> Face:
    """Return the properties of one pad's contact that are needed to describe the object between both pads."""
    of_fit = () if shape.centre is None else shape.standard_deviations[:2]
    place = _centre(shape)
    return Face(shape.class_name, shape.probabilities, (math.nan, math.nan) if place is None else place,
                max(of_fit, default=shape.centre_of_pressure_sd), _face_fit(shape), shape.pad_force,
                _pad_force_sd(shape), shape.pad_force_is_bound, shape.pressure_slope)


def _pad_force_sd(shape: PadShape) -> float:
    """Return the standard deviation of the force of all contacts [N].

    The variance of a force is the sum of the variances of its taxels, so it grows with the area of the contacts.
    """
    if shape.contacts < 2:
        return shape.force_sd
    return shape.force_sd * math.sqrt(sum(shape.contact_areas) / shape.contact_areas[0])


def _face_fit(shape: PadShape) -> FaceFit | None:
    """Return the fit, or None if it has no standard deviations, because they determine the weight of the fit."""
    if shape.centre is None or not shape.dimension_names:
        return None
    of_each = dict(zip(shape.parameter_names, map(float, shape.standard_deviations)))
    angle_sd = of_each.get('angle', math.inf)
    sds = tuple(of_each.get(name, 0.0) for name in shape.dimension_names)
    if not all(0 < sd < math.inf for sd in (*sds, *([angle_sd] if shape.symmetry else []))):
        return None
    return FaceFit(shape.angle, angle_sd, shape.symmetry, shape.handedness,
                   tuple(shape.dimension_names), tuple(shape.dimensions), sds, tuple(shape.dimension_is_bound))


def grasp_message(grasp: CurrentGrasp) -> Grasp:
    """Return the grasp as a message.

    Stamp and age come from the older of the two pad results. A receiver uses the stamp and the age to compute how long
    the message was delayed.
    """
    state, opening = grasp.state, grasp.opening
    words = state.contact.name, 'fresh' if state.fresh else 'not fresh', 'stable' if state.stable else 'not stable'
    message = Grasp(
        **_dated(grasp), message=', '.join(words), contact=int(state.contact), fresh=state.fresh, gap=opening.gap,
        gap_source=int(opening.source), gap_age=age_message(opening.age), same_shape=state.same_shape,
        stable=state.stable, held=duration_message(state.held), creep=state.creep, line_is_bound=state.line_is_bound)
    _add_line(message, state.line)
    is_held = state.fresh and state.contact is GraspContact.TWO_SIDED
    left, right = grasp.sides
    _add_object(message, held_object(face_of(left), face_of(right), grasp.gripper) if is_held else HeldObject())
    _add_sides(message, grasp)
    return message


def sides_message(grasp: CurrentGrasp) -> GraspSides:
    """Return the shapes on both sides of the grasp as a message, with the stamp and the age of `grasp_message`."""
    return GraspSides(**_dated(grasp), sides=[side.message for side in grasp.sides])


def _dated(grasp: CurrentGrasp) -> dict[str, Any]:
    return {'header': Header(stamp=_older(grasp.sides, grasp.ages).header.stamp, frame_id=grasp.frame_id),
            'age': age_message(max(grasp.ages)), 'side_states': [int(each) for each in grasp.state.side_states]}


def _older(sides: Sequence[PadShape], ages: Sequence[float]) -> PadShape:
    """Return the older of the two results. A side without a result is returned only if both sides have none."""
    by_age = sorted(zip(ages, sides), key=lambda each: each[0], reverse=True)
    received = [side for _, side in by_age if side.header.stamp.sec or side.header.stamp.nanosec]
    return received[0] if received else by_age[0][1]


def _add_line(message: Grasp, line: Line | None) -> None:
    nowhere = np.full(3, np.nan)
    left, right, middle, axis = (line.left, line.right, line.midpoint, line.axis) if line else (nowhere,) * 4
    for field, place in ((message.left_centre, left), (message.right_centre, right), (message.midpoint, middle),
                         (message.axis, axis)):
        field.x, field.y, field.z = place.tolist()
    message.width = line.width if line else math.nan
    message.offset = line.offset if line else math.nan
    message.misalignment = line.misalignment if line else math.nan


def _add_object(message: Grasp, held: HeldObject) -> None:
    for name, value in held._asdict().items():
        setattr(message, name, value)
    message.shape = number_of(held.class_name)
    message.confidence = single(held.confidence)


def _add_sides(message: Grasp, grasp: CurrentGrasp) -> None:
    states, sides = grasp.state.side_states, grasp.sides
    message.forces = [side.pad_force if each >= SideState.EMPTY else math.nan
                      for each, side in zip(states, sides)]
    message.force_is_bound = [side.pad_force_is_bound for side in sides]
    message.sequences = [side.sequence for side in sides]
    message.confidences = [side.confidence for side in sides]
    message.pads_seen = [side.pad_seen for side in sides]
    message.at_edge = [side.at_edge for side in sides]
    message.hidden_taxels = [side.hidden_taxels + side.hidden_ring_taxels for side in sides]
    message.saturated_taxels = [side.saturated_taxels + side.saturated_ring_taxels for side in sides]
    message.motions = [current_motion(side.motion, age, each >= SideState.EMPTY)
                       for each, side, age in zip(states, sides, grasp.ages)]
