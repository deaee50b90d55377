"""Grasps as messages, and the sides they are made of."""

import math

import numpy as np
from geometry_msgs.msg import Point, Vector3

from tactile_node.grasp.tracker import GraspState, Line, SideResult
from tactile_node.ros.shape_messages import SHAPE_OF_NUMBER
from tactile_node.ros.time_messages import duration_message, seconds, time_message
from tactile_node.shape.recognition import Shape
from tactile_skin.msg import ContactShape, Grasp


def side_result(message: ContactShape) -> SideResult:
    """What one pad reports; the centre is the fit's, or the centre of pressure where there is no fit."""
    shape = SHAPE_OF_NUMBER[message.shape]
    place = message.pose.pose.position if message.fit_valid else message.centre_of_pressure
    touched = shape is not Shape.NONE and np.isfinite((place.x, place.y)).all()
    return SideResult(seconds(message.header.stamp), shape, (place.x, place.y) if touched else None)


def grasp_message(state: GraspState, sides: list[ContactShape], gap: float, frame_id: str) -> Grasp:
    """``sides``: the latest message of the left and the right pad; ``gap`` [m]."""
    message = Grasp(gap=gap, sides=sides, contact=int(state.contact), fresh=state.fresh, same_shape=state.same_shape,
                    stable=state.stable, held=duration_message(state.held))
    message.header.stamp, message.header.frame_id = time_message(state.stamp), frame_id
    _add_line(message, state.line)
    return message


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
