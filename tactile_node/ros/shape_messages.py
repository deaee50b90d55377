"""Convert recognised, fused and fitted contacts to ROS messages."""

import math
from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, partial
from typing import Any

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
from tactile_skin.msg import ContactMotion, ContactShape, ContactShapes

#: code in ContactShape.msg -> name of the shape; the names of taught shapes have the code OTHER
NAME_OF_NUMBER: dict[int, str] = {getattr(ContactShape, shape.name): shape.value for shape in Shape}
NUMBER_OF_NAME = {name: number for number, name in NAME_OF_NUMBER.items()}
MOST_SHAPES = 4  #: maximum number of shapes in a ContactShapes message
SOLIDS = {'box': SolidPrimitive.BOX, 'cylinder': SolidPrimitive.CYLINDER}


def number_of(class_name: str) -> int:
    """Return the code of a shape in ContactShape.msg, which is OTHER for a taught shape."""
    return NUMBER_OF_NAME.get(class_name, ContactShape.OTHER)


@dataclass(frozen=True)
class PadShape:
    """The shape on a pad, with the values that a grasp reads.

    The values have the names and meanings of the fields of ContactShape.msg, unless a comment says otherwise. Building
    the message takes longer than computing the values, so it is built only when it is read.
    """

    header: Header
    sequence: int
    left_out: int
    acquired: float  #: time when the taxels were acquired, on the steady clock [s]; -inf if not known
    shape: int
    class_name: str
    confidence: float
    probabilities: dict[str, float]  #: probability of each class by name
    pad_seen: bool
    taxels: int
    hidden_taxels: int
    saturated_taxels: int
    ring_taxels: int
    hidden_ring_taxels: int
    saturated_ring_taxels: int
    at_edge: bool
    contacts: int
    contact_areas: Sequence[float]
    pitch: float  #: pitch of the pad [m]; 0 if there is no contact
    force: float
    force_sd: float
    pad_force: float
    pad_force_is_bound: bool
    centre_of_pressure: tuple[float, float]
    centre_of_pressure_sd: float
    centre_of_pressure_is_bound: bool
    pressure_slope: tuple[float, float]
    size_is_bound: bool
    motion: ContactMotion
    make_message: Callable[['PadShape'], ContactShape]  #: returns the message of this shape

    # The fit; without one, the centre is None.
    centre: tuple[float, float] | None = None  #: centre of the fitted shape [m]
    angle: float = math.nan  #: angle of the fitted shape's own x axis, from x towards y of the pad [rad]
    symmetry: int = 0
    handedness: int = 0
    dimension_names: Sequence[str] = ()
    dimensions: Sequence[float] = ()
    dimension_is_bound: Sequence[bool] = ()
    parameter_names: Sequence[str] = ()
    standard_deviations: Sequence[float] = ()

    @cached_property
    def message(self) -> ContactShape:
        """Message with all its fields."""
        return self.make_message(self)

    @classmethod
    def of(cls, contact: PadContact, result: StreamedContact, method: str, solid_height: float) -> 'PadShape':
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
            Height of the solid to add to the message [m]; 0 to add no solid.
        """
        fused, pattern, seen = result.fused.recognition, result.found.pattern, result.found.visibility
        moments, fit, taxels = result.moments, result.fit, int(np.count_nonzero(result.found.pattern.mask))
        contact_areas = [size * result.found.taxels.pitch**2 for size in pattern.sizes]
        pad_force, pad_force_is_bound = result.found.pad_force(moments)
        of_fit: dict[str, Any] = {} if fit is None else {
            'centre': fit.centre, 'angle': _angle_of(*_turn(fit)), 'symmetry': fit.symmetry,
            'handedness': fit.handedness, 'dimension_names': fit.dimension_names, 'dimensions': fit.dimensions,
            'dimension_is_bound': fit.is_bound, 'parameter_names': fit.parameter_names,
            'standard_deviations': np.sqrt(fit.covariance.diagonal()).tolist()}
        return cls(
            header=contact.header, sequence=contact.sequence, left_out=contact.left_out, acquired=contact.acquired,
            shape=number_of(fused.shape.value), class_name=fused.shape.value, confidence=single(fused.confidence),
            probabilities=dict(zip((each.value for each in fused.probabilities),
                                   array('f', fused.probabilities.values()))),
            pad_seen=seen.pad_seen, taxels=taxels, hidden_taxels=seen.hidden_in_contact,
            saturated_taxels=seen.saturated_in_contact, ring_taxels=seen.ring, hidden_ring_taxels=seen.hidden_in_ring,
            saturated_ring_taxels=seen.saturated_in_ring, at_edge=seen.at_edge, contacts=pattern.contacts,
            contact_areas=contact_areas, pitch=_pitch_of(contact_areas, max(pattern.sizes, default=0)),
            force=moments.force, force_sd=moments.force_sd, pad_force=pad_force, pad_force_is_bound=pad_force_is_bound,
            centre_of_pressure=moments.centre_of_pressure,
            centre_of_pressure_sd=float(max(moments.centre_of_pressure_sd)),
            centre_of_pressure_is_bound=moments.centre_of_pressure_is_bound, pressure_slope=moments.slope,
            size_is_bound=moments.size_is_bound, motion=motion_message(result.motion, seconds(contact.header.stamp)),
            make_message=partial(_message, contact, result, method, solid_height), **of_fit)


#: fields that a message copies from a `PadShape`
COPIED = ({each.name for each in fields(PadShape)} & set(ContactShape.get_fields_and_field_types())
          - {'probabilities', 'centre_of_pressure'})


def pad_shape_of(message: ContactShape, acquired: float = -math.inf) -> PadShape:
    """Return the shape in a message, whose taxels were acquired at ``acquired`` on the steady clock [s]."""
    place, pressed = message.pose.pose.position, message.centre_of_pressure
    others: dict[str, Any] = {
        'acquired': acquired, 'probabilities': dict(zip(message.class_names, map(float, message.probabilities))),
        'pitch': contact_pitch(message), 'centre_of_pressure': (pressed.x, pressed.y),
        'pressure_slope': tuple(message.pressure_slope), 'make_message': lambda shape: message,
        'centre': (place.x, place.y) if message.fit_valid else None, 'angle': fitted_angle(message)}
    return PadShape(**others, **{each.name: getattr(message, each.name) for each in fields(PadShape)
                                 if each.name not in others})


def contact_pitch(message: ContactShape) -> float:
    """Return the pitch of the pad [m], or 0 if there is no contact. ``message`` describes the largest contact."""
    return _pitch_of(message.contact_areas, message.taxels) if message.contacts else 0.0


def fitted_angle(message: ContactShape) -> float:
    """Return the angle of the fitted shape's own x axis, from x towards y of the pad [rad]."""
    turn = message.pose.pose.orientation
    return _angle_of(turn.z, turn.w)


def shapes_message(contact: PadContact, contacts: int, shapes: list[ContactShape]) -> ContactShapes:
    """Return a message with the ``shapes`` of the largest contacts and the number of all ``contacts`` on the pad."""
    return ContactShapes(header=contact.header, sequence=contact.sequence, state=pad_state(contact.found),
                         contacts=contacts, pad_seen=contact.found.visibility.pad_seen, shapes=shapes)


def pose_message(shape: ContactShape) -> PoseWithCovarianceStamped:
    """Return only the fitted pose, as the message type that localisation tools use."""
    return PoseWithCovarianceStamped(header=shape.header, pose=shape.pose)


def _pitch_of(contact_areas: Sequence[float], largest: int) -> float:
    """Return the pitch from the areas of all contacts and the number of taxels of the ``largest`` one."""
    return math.sqrt(contact_areas[0] / largest) if largest and contact_areas else 0.0


def _turn(fit: ShapeFit) -> tuple[float, float]:
    """Return the components z and w of the rotation from the pad to the fitted shape as a quaternion."""
    return float(np.sin(fit.angle / 2)), float(np.cos(fit.angle / 2))


def _angle_of(z: float, w: float) -> float:
    return 2 * math.atan2(z, w)


def _message(contact: PadContact, result: StreamedContact, method: str, solid_height: float,
             shape: PadShape) -> ContactShape:
    """Return the message of a shape. Box, solid, outline and covariances are computed only here."""
    fused, alone, moments, fit = result.fused, result.recognition, result.moments, result.fit
    box, probabilities = result.found.box, result.fused.recognition.probabilities
    covariance = np.full(36, np.nan) if fit is None else fit.pose_covariance.reshape(-1)
    x, y = shape.centre_of_pressure
    message = ContactShape(
        **{name: getattr(shape, name) for name in COPIED}, age=age_since(contact.acquired),
        unknown_reason=fused.recognition.reason, class_names=list(shape.probabilities),
        probabilities=array('f', probabilities.values()), frame_shape=number_of(alone.shape.value),
        frame_class_name=alone.shape.value,
        frame_probabilities=[alone.probabilities.get(each, 0.0) for each in probabilities],
        held=duration_message(fused.held), fused_frames=fused.frames, method=method,
        missing_can_frames=contact.frame.missing_can_frames, others_present=shape.contacts > 1,
        force_is_bound=moments.force_is_bound, centre_of_pressure=Point(x=x, y=y), contact_area=moments.area,
        fit_valid=fit is not None,
        pose=PoseWithCovariance(pose=_pose(fit), covariance=covariance),
        principal_axis=principal_axis(result.found.pattern.mask), residual=math.nan if fit is None else fit.residual)
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


def _pose(fit: ShapeFit | None) -> Pose:
    """Return the pose of the fit. Without a fit, every number is NaN, so that no reader takes the pose as valid."""
    message = Pose()
    place, turn = message.position, message.orientation
    if fit is None:
        place.x = place.y = place.z = turn.x = turn.y = turn.z = turn.w = math.nan
    else:
        place.x, place.y = fit.centre
        turn.z, turn.w = _turn(fit)
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
