"""Check a Grasp before a node uses it; see message_checks.py."""

import math

from tactile_node.grasp.held_object import LEAST_PROBABILITY
from tactile_node.grasp.tracker import GraspContact, SideState
from tactile_node.ros.message_checks import (
    PROBABILITY_TOLERANCE,
    SHAPE_NUMBERS_KNOWN,
    RejectReason,
    check_contact_shape,
    check_times,
    is_named,
)
from tactile_node.ros.motion_messages import check_motion
from tactile_node.skin.taxel_array import check_duration, check_finite
from tactile_skin.msg import ContactShape, Grasp, GraspSides

ROUNDING = 1e-9  #: rounding tolerance for sums of numbers that are about 1


def check_grasp(message: Grasp) -> RejectReason | None:
    """Check the states of both pads, the line between the contacts, the object and the forces."""
    return (_grasp_codes(message)
            or _grasp_states(message)
            or _line(message)
            or _object_class(message)
            or _sizes(message)
            or _yaw(message)
            or _lean(message)
            or _forces(message)
            or _motions(message)
            or check_times(message)
            or check_duration(message.held)
            or check_duration(message.gap_age))


def check_grasp_sides(message: GraspSides) -> RejectReason | None:
    """Check the states, the times, and each result that a pad has produced."""
    if max(message.side_states) > Grasp.SIDE_TOUCHED:
        return RejectReason.UNKNOWN_CODE
    reasons = [check_contact_shape(side) for state, side in zip(message.side_states, message.sides)
               if state != Grasp.SIDE_NOT_KNOWN]
    return next(filter(None, reasons), None) or check_times(message)


def _grasp_codes(message: Grasp) -> RejectReason | None:
    is_known = (message.contact in tuple(GraspContact) and message.gap_source <= Grasp.GAP_TF
                and max(message.side_states) <= Grasp.SIDE_TOUCHED)
    return None if is_known else RejectReason.UNKNOWN_CODE


def _grasp_states(message: Grasp) -> RejectReason | None:
    """Check that ``contact`` follows from the states of both pads, and that ``fresh`` and ``stable`` agree with it."""
    left, right = map(SideState, message.side_states)
    if left is right is SideState.NOT_KNOWN:  # a default-constructed message contains no result
        return RejectReason.INCONSISTENT
    contact = GraspContact.of((left, right))
    fits = (message.contact == contact and not (message.fresh and contact == Grasp.NOT_KNOWN)
            and not (message.stable and not _is_held(message))
            and not (message.same_shape and contact != Grasp.TWO_SIDED))
    return None if fits else RejectReason.INCONSISTENT


def _line(message: Grasp) -> RejectReason | None:
    """Check the line between the contact centres of a fresh grasp.

    A fresh grasp has a line unless a contact centre is not known. Without an opening, only the offset of the line is
    known.
    """
    if math.isinf(message.gap) or math.isinf(message.centre_sd):
        return RejectReason.NOT_FINITE
    if message.gap_source == Grasp.GAP_NOT_KNOWN and math.isfinite(message.gap):
        return RejectReason.INCONSISTENT
    middle = message.midpoint
    of_gap = (middle.x, middle.y, middle.z, message.width, message.misalignment)
    across, has_line = (message.offset, *message.centre), _is_held(message)
    if has_line and not message.stable and all(map(math.isnan, (message.centre_sd, *across, *of_gap))):
        return None
    if has_line and math.isfinite(message.gap):
        return check_finite(*across, *of_gap)
    if not all(map(math.isnan, of_gap if has_line else (message.centre_sd, *across, *of_gap))):
        return RejectReason.INCONSISTENT
    return check_finite(*across) if has_line else None


def _is_held(message: Grasp) -> bool:
    return message.fresh and message.contact == Grasp.TWO_SIDED


def _object_class(message: Grasp) -> RejectReason | None:
    """Check that only a held object has a class, and that this class is more probable than all others combined."""
    if message.shape not in SHAPE_NUMBERS_KNOWN or message.shape == ContactShape.NONE:
        return RejectReason.UNKNOWN_CODE
    certainties = message.confidence, *message.confidences
    if not all(map(math.isfinite, certainties)):
        return RejectReason.NOT_FINITE
    if not 0 <= min(certainties) <= max(certainties) <= 1 + PROBABILITY_TOLERANCE:
        return RejectReason.WRONG_PROBABILITIES
    is_known = message.shape != ContactShape.UNKNOWN
    fits = (is_named(message.shape, message.class_name) and (_is_held(message) or not message.confidence)
            and (message.confidence >= LEAST_PROBABILITY if is_known else message.confidence <= LEAST_PROBABILITY))
    return None if fits else RejectReason.INCONSISTENT


def _sizes(message: Grasp) -> RejectReason | None:
    sizes, sds = message.dimensions, message.dimension_sds
    if {len(message.dimension_names), len(sds), len(message.dimension_is_bound)} != {len(sizes)}:
        return RejectReason.WRONG_LENGTH
    if len(sizes) and message.shape == ContactShape.UNKNOWN or min(sizes, default=1) <= 0 or min(sds, default=1) <= 0:
        return RejectReason.INCONSISTENT
    return check_finite(*sizes, *sds)


def _yaw(message: Grasp) -> RejectReason | None:
    """Check the yaw.

    Only a shape with a symmetry may have a yaw, which must lie within -pi/symmetry and pi/symmetry. Only a shape with a
    yaw may have a handedness.
    """
    has_yaw, is_right_triangle = not math.isnan(message.yaw), message.shape == ContactShape.RIGHT_TRIANGLE
    fits = (has_yaw != math.isnan(message.yaw_sd) and (not message.symmetry or len(message.dimensions))
            and abs(message.handedness) == (has_yaw and is_right_triangle)
            and (not has_yaw or message.symmetry and abs(message.yaw) <= math.pi / message.symmetry + ROUNDING))
    if not fits:
        return RejectReason.INCONSISTENT
    return check_finite(message.yaw, message.yaw_sd) if has_yaw else None


def _lean(message: Grasp) -> RejectReason | None:
    if all(map(math.isnan, message.lean)):
        return None
    return check_finite(*message.lean) if _is_held(message) else RejectReason.INCONSISTENT


def _forces(message: Grasp) -> RejectReason | None:
    """Check that a pad that is not seen has no force, and that the grip force is the mean of two known forces."""
    grip, grip_sd = (message.grip_force, message.force_imbalance), message.grip_force_sd
    if any(map(math.isinf, (*message.forces, grip_sd))):
        return RejectReason.NOT_FINITE
    if not all(math.isnan(force) for force, state in zip(message.forces, message.side_states)
               if state <= Grasp.SIDE_UNSEEN):
        return RejectReason.INCONSISTENT
    if all(map(math.isnan, (*grip, grip_sd))):
        return None
    left, right = message.forces
    fits = (_is_held(message) and not any(message.force_is_bound)
            and all(math.isclose(found, each, rel_tol=ROUNDING, abs_tol=ROUNDING)
                    for found, each in zip(grip, ((left + right) / 2, left - right))))
    return None if fits else RejectReason.INCONSISTENT


def _motions(message: Grasp) -> RejectReason | None:
    """Check the motions. The motion on a pad that is not seen must be NOT_KNOWN."""
    wrong = [motion.moving for motion, state in zip(message.motions, message.side_states) if state <= Grasp.SIDE_UNSEEN]
    return RejectReason.INCONSISTENT if any(wrong) else next(filter(None, map(check_motion, message.motions)), None)
