"""A contact and its shape as markers, which RViz and Foxglove draw without a plugin.

Each message has the same markers, each alone in its namespace, id 0: added, or deleted where nothing of its kind holds.
So no viewer keeps what an earlier message drew, whatever it has missed. All are in the frame of the pad, and of one
taxel frame: the outline is never drawn over newer taxels.
"""

import math

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from tactile_node.colour_map import ColourScale, rgb_table
from tactile_node.frames.taxel_frame import TaxelStatus
from tactile_node.ros.contact_messages import taxels_of
from tactile_node.ros.taxel_messages import taxel_values
from tactile_node.ros.time_messages import duration_message
from tactile_node.shape.recognition import UnknownReason
from tactile_skin.msg import Contact, ContactShape

WHOLE = ColorRGBA(r=0.16, g=0.9, b=1.0, a=1.0)  #: cyan: as fitted
BOUND = ColorRGBA(r=1.0, g=0.6, b=0.0, a=1.0)  #: orange: what is seen; the whole may be another (*_is_bound)
TEXT = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)
X_AXIS, Y_AXIS = ColorRGBA(r=1.0, g=0.2, b=0.2, a=1.0), ColorRGBA(r=0.3, g=0.5, b=1.0, a=1.0)
# In units of the pitch:
TAXEL, THICKNESS, LINE, ABOVE, DOT, LETTER = 0.9, 0.2, 0.25, 0.15, 0.8, 1.5


class ContactMarkers:
    """Markers of one pad: `taxels`, `outline`, `axes`, `centre_of_pressure`, `name`."""

    def __init__(self, scale: ColourScale):
        self._scale = scale
        self._palette = [ColorRGBA(r=r, g=g, b=b, a=1.0) for r, g, b in (rgb_table() / 255.0).tolist()]
        self._grid: tuple[int, int, float] | None = None
        self._centres: list[Point] = []  # of the taxels of _grid, kept: 256 new ones take longer than all else

    def message(self, contact: Contact, shape: ContactShape, lifetime: float) -> MarkerArray:
        """Return the markers of ``shape``, which was made of ``contact``; ``lifetime`` [s] of those that are added."""
        found = {'taxels': self._taxels(contact), 'outline': _outline(contact, shape), 'axes': _axes(contact, shape),
                 'centre_of_pressure': _centre_of_pressure(contact, shape), 'name': _name(contact, shape)}
        duration = duration_message(lifetime)
        markers = []
        for name, marker in found.items():
            if marker is None:
                marker = Marker(action=Marker.DELETE)
            else:
                marker.lifetime = duration
            marker.header, marker.ns = contact.header, name
            markers.append(marker)
        return MarkerArray(markers=markers)

    def _taxels(self, contact: Contact) -> Marker | None:
        """Each taxel of the pad in the colour of its value; its upper side is the skin's surface."""
        numbers = self._scale.numbers(taxel_values(contact), taxels_of(contact, TaxelStatus.SATURATED), contact.unit)
        places = np.flatnonzero(~taxels_of(contact, TaxelStatus.UNMAPPED)).tolist()
        if not places:
            return None
        centres, palette, pitch = self._centres_of(contact), self._palette, contact.pitch
        colours = numbers.reshape(-1).tolist()
        marker = _marker(Marker.CUBE_LIST, TAXEL * pitch, TAXEL * pitch, THICKNESS * pitch)
        marker.color = TEXT  # not used: each has its own
        marker.points = [centres[place] for place in places]
        marker.colors = [palette[colours[place]] for place in places]
        return marker

    def _centres_of(self, contact: Contact) -> list[Point]:
        grid = contact.rows, contact.cols, contact.pitch
        if grid != self._grid:
            below = -THICKNESS / 2 * contact.pitch
            self._centres = [Point(x=col * contact.pitch, y=row * contact.pitch, z=below)
                             for row in range(contact.rows) for col in range(contact.cols)]
            self._grid = grid
        return self._centres


def _outline(contact: Contact, shape: ContactShape) -> Marker | None:
    """The fitted outline, closed; without a fit there is none."""
    if not shape.fit_valid or not shape.outline.points:
        return None
    marker = _marker(Marker.LINE_STRIP, LINE * contact.pitch)
    marker.color = BOUND if shape.size_is_bound else WHOLE
    corners = [_above(contact, corner.x, corner.y) for corner in shape.outline.points]
    marker.points = [*corners, corners[0]]
    return marker


def _axes(contact: Contact, shape: ContactShape) -> Marker | None:
    """The shape's own x (red) and y axis (blue) from its centre; a circle has none."""
    if not shape.fit_valid or not shape.symmetry:
        return None
    pose = shape.pose.pose
    angle = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
    length = max(shape.dimensions) / 2
    x, y = length * math.cos(angle), length * math.sin(angle)
    centre = _above(contact, pose.position.x, pose.position.y)
    marker = _marker(Marker.LINE_LIST, LINE * contact.pitch)
    marker.color = TEXT  # not used: each point has its own
    marker.points = [centre, _above(contact, centre.x + x, centre.y + y),
                     centre, _above(contact, centre.x - y, centre.y + x)]
    marker.colors = [X_AXIS, X_AXIS, Y_AXIS, Y_AXIS]
    return marker


def _centre_of_pressure(contact: Contact, shape: ContactShape) -> Marker | None:
    centre = shape.centre_of_pressure
    if not (math.isfinite(centre.x) and math.isfinite(centre.y)):
        return None
    marker = _marker(Marker.SPHERE, *(DOT * contact.pitch,) * 3)
    marker.color = BOUND if shape.centre_of_pressure_is_bound else WHOLE
    marker.pose.position = Point(x=centre.x, y=centre.y)
    return marker


def _name(contact: Contact, shape: ContactShape) -> Marker:
    """Class and its probability, beyond the last row: always there, also of an empty or unseen pad."""
    marker = _marker(Marker.TEXT_VIEW_FACING, height=LETTER * contact.pitch)
    marker.color = TEXT
    marker.pose.position = Point(x=(contact.cols - 1) / 2 * contact.pitch, y=(contact.rows + LETTER) * contact.pitch)
    marker.text = _words(shape)
    return marker


def _words(shape: ContactShape) -> str:
    name = shape.class_name.replace('_', ' ')
    if shape.shape == ContactShape.UNKNOWN:
        name += f' ({UnknownReason(shape.unknown_reason).name.lower().replace("_", " ")})'
    return f'{name} {shape.confidence:.0%}'


def _marker(kind: int, width: float = 0.0, depth: float = 0.0, height: float = 0.0) -> Marker:
    """A marker at the origin of the pad's frame; its scale has what RViz uses of its ``kind``, else 0."""
    return Marker(type=kind, action=Marker.ADD, scale=Vector3(x=width, y=depth, z=height),
                  pose=Pose(orientation=Quaternion(w=1.0)))


def _above(contact: Contact, x: float, y: float) -> Point:
    """A point of a line over the skin [m], which the taxels do not hide."""
    return Point(x=float(x), y=float(y), z=ABOVE * contact.pitch)
