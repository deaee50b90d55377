"""Convert recognised, fused and fitted contacts to ROS messages."""

import math
from array import array
from functools import cached_property
from types import SimpleNamespace

import numpy as np
from geometry_msgs.msg import Point, Point32, Polygon, Pose, PoseWithCovariance, PoseWithCovarianceStamped
from shape_msgs.msg import Mesh, MeshTriangle, SolidPrimitive
from std_msgs.msg import Header

from tactile_node.pose.fit import ShapeFit
from tactile_node.pose.moments import principal_axis
from tactile_node.pose.pipeline import StreamedContact
from tactile_node.ros.contact_messages import PadContact, pad_state, single
from tactile_node.ros.message_age import age_since
from tactile_node.ros.motion_messages import motion_message
from tactile_node.ros.time_messages import duration_message, seconds
from tactile_node.shape.recognition import Shape
from tactile_skin.msg import ContactShape, ContactShapes

#: code in ContactShape.msg -> name of the shape; the names of taught shapes have the code OTHER
NAME_OF_NUMBER: dict[int, str] = {getattr(ContactShape, shape.name): shape.value for shape in Shape}
NUMBER_OF_NAME = {name: number for number, name in NAME_OF_NUMBER.items()}
MOST_SHAPES = 4  #: maximum number of shapes in a ContactShapes message
SOLIDS = {'box': SolidPrimitive.BOX, 'cylinder': SolidPrimitive.CYLINDER}


def number_of(class_name: str) -> int:
    """Return the code of a shape in ContactShape.msg, which is OTHER for a taught shape."""
    return NUMBER_OF_NAME.get(class_name, ContactShape.OTHER)


class PadShape:
    """The shape on a pad.

    Building the message takes longer than computing all fields that a grasp reads, so it is built only when it is read.

    Parameters
    ----------
    fields
        Received message, or an object with those of its fields that a grasp reads.
    result
        Result from which ``fields`` was created; None for a received message.
    solid_height
        Height of the solid to add [m]; 0 to add no solid.
    acquired
        Time when the taxels were acquired, on the steady clock [s]; -inf if not known.
    """

    def __init__(self, fields: ContactShape, result: StreamedContact | None = None, solid_height: float = 0.0, *,
                 acquired: float = -math.inf):
        self.fields, self._result, self._solid_height = fields, result, solid_height
        self.acquired = acquired

    @cached_property
    def message(self) -> ContactShape:
        """Message with all its fields."""
        return self.fields if self._result is None else _complete(self.fields, self._result, self._solid_height)

    @property
    def header(self) -> Header:
        return self.fields.header

    @property
    def sequence(self) -> int:
        return int(self.fields.sequence)

    @property
    def left_out(self) -> int:
        return int(self.fields.left_out)


def pad_shape_of(message: ContactShape, acquired: float) -> PadShape:
    """Return the shape in a message, whose taxels were acquired at ``acquired`` on the steady clock [s]."""
    return PadShape(message, acquired=acquired)


def pad_shape(contact: PadContact, result: StreamedContact, method: str, solid_height: float) -> PadShape:
    """Return the shape of a result.

    Parameters
    ----------
    contact
        Contacts in the taxel frame.
    result
        Recognised, fused and fitted contact.
    method
        Name of the recognition method.
    solid_height
        Height of the solid to add [m]; 0 to add no solid.
    """
    fused, alone, pattern = result.fused.recognition, result.recognition, result.found.pattern
    seen, moments, fit = result.found.visibility, result.moments, result.fit
    pad_force, pad_force_is_bound = result.found.pad_force(moments)
    x, y = moments.centre_of_pressure
    fields = SimpleNamespace(
        header=contact.header, sequence=contact.sequence, left_out=contact.left_out,
        age=age_since(contact.acquired), shape=number_of(fused.shape.value),
        class_name=fused.shape.value, unknown_reason=fused.reason, confidence=single(fused.confidence),
        class_names=[shape.value for shape in fused.probabilities],
        probabilities=array('f', fused.probabilities.values()),
        frame_shape=number_of(alone.shape.value), frame_class_name=alone.shape.value,
        held=duration_message(result.fused.held),
        fused_frames=result.fused.frames, method=method, pad_seen=seen.pad_seen,
        taxels=int(np.count_nonzero(pattern.mask)), hidden_taxels=seen.hidden_in_contact,
        saturated_taxels=seen.saturated_in_contact, ring_taxels=seen.ring, hidden_ring_taxels=seen.hidden_in_ring,
        saturated_ring_taxels=seen.saturated_in_ring, at_edge=seen.at_edge,
        missing_can_frames=contact.frame.missing_can_frames,
        contacts=pattern.contacts, others_present=pattern.contacts > 1,
        contact_areas=[taxels * result.found.taxels.pitch**2 for taxels in pattern.sizes],
        force=moments.force, force_sd=moments.force_sd, force_is_bound=moments.force_is_bound, pad_force=pad_force,
        pad_force_is_bound=pad_force_is_bound, centre_of_pressure=Point(x=x, y=y),
        centre_of_pressure_sd=float(max(moments.centre_of_pressure_sd)),
        centre_of_pressure_is_bound=moments.centre_of_pressure_is_bound, contact_area=moments.area,
        pressure_slope=moments.slope, size_is_bound=moments.size_is_bound,
        motion=motion_message(result.motion, seconds(contact.header.stamp)), fit_valid=fit is not None,
        pose=SimpleNamespace(pose=_pose(fit)))
    if fit is not None:
        _add_fit(fields, fit)
    return PadShape(fields, result, solid_height, acquired=contact.acquired)


def contact_pitch(message: ContactShape) -> float:
    """Return the pitch of the pad [m], or 0 if there is no contact."""
    return math.sqrt(message.contact_areas[0] / message.taxels) if message.taxels and message.contacts else 0.0


def fitted_angle(message: ContactShape) -> float:
    """Return the angle of the fitted shape's own x axis, from x towards y of the pad [rad]."""
    turn = message.pose.pose.orientation
    return 2 * math.atan2(turn.z, turn.w)


def shapes_message(contact: PadContact, contacts: int, shapes: list[ContactShape]) -> ContactShapes:
    """Return a message with the ``shapes`` of the largest contacts and the number of all ``contacts`` on the pad."""
    return ContactShapes(header=contact.header, sequence=contact.sequence, state=pad_state(contact.found),
                         contacts=contacts, pad_seen=contact.found.visibility.pad_seen, shapes=shapes)


def pose_message(shape: ContactShape) -> PoseWithCovarianceStamped:
    """Return only the fitted pose, as the message type that localisation tools use."""
    return PoseWithCovarianceStamped(header=shape.header, pose=shape.pose)


def _complete(fields: SimpleNamespace, result: StreamedContact, solid_height: float) -> ContactShape:
    """Return the message with ``fields`` and with those that no grasp reads, such as box, solid and outline."""
    box, fit, alone = result.found.box, result.fit, result.recognition.probabilities
    covariance = np.full(36, np.nan) if fit is None else fit.pose_covariance.reshape(-1)
    pose = PoseWithCovariance(pose=fields.pose.pose, covariance=covariance)
    message = ContactShape(**vars(fields) | {'pose': pose})
    message.frame_probabilities = [alone.get(shape, 0.0) for shape in result.fused.recognition.probabilities]
    message.principal_axis = principal_axis(result.found.pattern.mask)
    message.residual = math.nan if fit is None else fit.residual
    message.box_centre.x, message.box_centre.y = box.centre
    message.box_angle, message.box_lengths = box.angle, box.lengths
    message.box_centre_sd, message.box_angle_sd, message.box_lengths_sd = box.centre_sd, box.angle_sd, box.lengths_sd
    message.box_length_is_bound, message.hollow = box.length_is_bound, box.hollow
    if fit is not None:
        message.covariance = fit.covariance.reshape(-1)
        message.outline = Polygon(points=[Point32(x=x, y=y) for x, y in fit.outline.tolist()])
        if solid_height > 0 and not box.hollow:
            _add_solid(message, fit, solid_height)
    return message


def _add_fit(fields: SimpleNamespace, fit: ShapeFit) -> None:
    fields.symmetry, fields.handedness = fit.symmetry, fit.handedness
    fields.dimension_names, fields.dimensions = fit.dimension_names, fit.dimensions
    fields.dimension_is_bound = fit.is_bound
    fields.parameter_names = fit.parameter_names
    fields.standard_deviations = np.sqrt(fit.covariance.diagonal()).tolist()


def _pose(fit: ShapeFit | None) -> Pose:
    """Return the pose of the fit. Without a fit, every number is NaN, so that no reader takes the pose as valid."""
    message = Pose()
    place, turn = message.position, message.orientation
    if fit is None:
        place.x = place.y = place.z = turn.x = turn.y = turn.z = turn.w = math.nan
    else:
        place.x, place.y = fit.centre
        turn.z, turn.w = float(np.sin(fit.angle / 2)), float(np.cos(fit.angle / 2))
    return message


def _add_solid(message: ContactShape, fit: ShapeFit, height: float) -> None:
    primitive = fit.solid(height)
    if primitive is not None:
        kind, dimensions = primitive
        message.solid = SolidPrimitive(type=SOLIDS[kind], dimensions=dimensions)
        return
    vertices, triangles = fit.prism(height)
    message.mesh = Mesh(vertices=[Point(x=x, y=y, z=z) for x, y, z in vertices.tolist()],
                        triangles=[MeshTriangle(vertex_indices=corners) for corners in triangles.astype(np.uint32)])
