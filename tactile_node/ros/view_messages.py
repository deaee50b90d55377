"""What viewers draw of a pad: a contact and its shape as markers, taxels as images, what presses as one wrench.

Each message of markers has the same ones, each alone in its namespace, id 0: added, or deleted where nothing of its
kind holds. So no viewer keeps what an earlier message drew, whatever it has missed. All are in the frame of the pad,
and of one taxel frame: the outline is never drawn over newer taxels.

Row 0 of an image is row 0 of the pad. A viewer draws it at the top, so that y of the pad runs down and z points away:
the picture is that of the pad from behind, as from inside the finger.
"""

import math
import sys
from array import array
from collections import deque
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3, Wrench, WrenchStamped
from sensor_msgs.msg import Image
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from tactile_node.colour_map import RGB_TABLE, ColourScale
from tactile_node.contact.pattern import MOST_LABELS, ContactPattern, of_contact
from tactile_node.contact.visibility import visibility_of
from tactile_node.pose.moments import contact_moments
from tactile_node.ros.contact_messages import as_array, taxel_values, taxels_of
from tactile_node.ros.time_messages import duration_message
from tactile_node.shape.recognition import UnknownReason
from tactile_node.taxel_frame import ON_OFF_UNIT, SkinSide, TaxelStatus
from tactile_skin.msg import Contact, ContactShape, TaxelArray

WHOLE_COLOUR = ColorRGBA(r=0.16, g=0.9, b=1.0, a=1.0)  #: cyan: as fitted
BOUND_COLOUR = ColorRGBA(r=1.0, g=0.6, b=0.0, a=1.0)  #: orange: what is seen; the whole may be another (*_is_bound)
TEXT = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)
X_AXIS, Y_AXIS = ColorRGBA(r=1.0, g=0.2, b=0.2, a=1.0), ColorRGBA(r=0.3, g=0.5, b=1.0, a=1.0)
# In units of the pitch:
TAXEL, THICKNESS, LINE_WIDTH, ABOVE, DOT, LETTER = 0.9, 0.2, 0.25, 0.15, 0.8, 1.5
SHORTEST_LIFETIME = 0.5  #: s; a viewer that is late for a moment does not flicker
LONGEST_LIFETIME = 30.0  #: s; three periods of the slowest SYNC
PERIODS = 3.0   #: between two messages
#: Names of sensor_msgs/image_encodings.hpp
VALUES, COLOURS = '32FC1', 'rgb8'


class ContactMarkers:
    """Markers of one pad: `taxels`, `outline`, `axes`, `centre_of_pressure`, `name`."""

    def __init__(self, scale: ColourScale):
        self._scale = scale
        self._palette = [ColorRGBA(r=r, g=g, b=b, a=1.0) for r, g, b in (RGB_TABLE / 255.0).tolist()]
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
    marker = _marker(Marker.LINE_STRIP, LINE_WIDTH * contact.pitch)
    marker.color = BOUND_COLOUR if shape.size_is_bound else WHOLE_COLOUR
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
    marker = _marker(Marker.LINE_LIST, LINE_WIDTH * contact.pitch)
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
    marker.color = BOUND_COLOUR if shape.centre_of_pressure_is_bound else WHOLE_COLOUR
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


class MarkerLifetime:
    """From the time between the messages that are drawn.

    A viewer measures by its own clock, which in a replay with use_sim_time is that of the log, else the steady one:
    the longer of both counts. Of the last two times the shorter counts: what follows an outage is not shown as long.
    """

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None
        self._gaps: deque[float] = deque(maxlen=2)

    def after(self, steady: float, stamp: float) -> float:
        """Return the lifetime [s] of markers that are sent at ``steady`` [s] of a message of ``stamp`` [s]."""
        if self._last is not None:
            self._gaps.append(max(steady - self._last[0], stamp - self._last[1]))
        self._last = steady, stamp
        gap = min(self._gaps, default=0.0)
        return min(max(SHORTEST_LIFETIME, PERIODS * gap), LONGEST_LIFETIME) if math.isfinite(gap) else SHORTEST_LIFETIME


def value_image(taxels: TaxelArray) -> Image:
    """Return the values as they are [unit of the taxels], NaN = no valid value; of saturated taxels a lower bound."""
    return Image(header=taxels.header, height=taxels.rows, width=taxels.cols, encoding=VALUES,
                 is_bigendian=sys.byteorder == 'big', step=4 * taxels.cols, data=array('B', taxels.values.tobytes()))


def colour_image(taxels: TaxelArray, scale: ColourScale) -> Image:
    """Return the colours of the values by ``scale``."""
    numbers = scale.numbers(taxel_values(taxels), taxels_of(taxels, TaxelStatus.SATURATED), taxels.unit)
    return Image(header=taxels.header, height=taxels.rows, width=taxels.cols, encoding=COLOURS, is_bigendian=False,
                 step=3 * taxels.cols, data=as_array('B', RGB_TABLE[numbers], np.uint8))


class _Pressing(NamedTuple):
    force: float  # [N]
    x: float      # of its centre [m]
    y: float


def wrench_message(contact: Contact, pattern: ContactPattern) -> WrenchStamped:
    """Return the wrench that the pressures of all contacts exert on the pad, about the origin of the pad's frame.

    z points out of the skin: what presses has a force.z below 0. With a force F at (x, y) the torque is (-y F, x F, 0).
    Pressures give nothing along x and y and no torque about z: these are 0, whatever shear there is. All six are NaN
    where the force is not known: taxels are hidden where something may press, are saturated, or are on/off.
    ``pattern``: of ``contact``.
    """
    pressing = _known(contact, pattern)
    wrench = Wrench(force=Vector3(), torque=Vector3())
    if pressing is None:
        for part in (wrench.force, wrench.torque):
            part.x = part.y = part.z = math.nan
    else:
        wrench.force.z = 0.0 - sum(each.force for each in pressing)
        wrench.torque.x = 0.0 - sum(each.force * each.y for each in pressing)
        wrench.torque.y = 0.0 + sum(each.force * each.x for each in pressing)
    return WrenchStamped(header=contact.header, wrench=wrench)


def _known(contact: Contact, pattern: ContactPattern) -> list[_Pressing] | None:
    """Return the force and centre of each contact, None unless all of them are known and whole."""
    if not contact.pad_seen or contact.unit == ON_OFF_UNIT or pattern.contacts > MOST_LABELS:
        return None
    found = []
    for number in range(1, pattern.contacts + 1):
        part = of_contact(pattern, number)
        moments = contact_moments(part.values, part.mask, contact.pitch, contact.unit,
                                  visibility_of(part, contact.smallest_contact, SkinSide(contact.finger_ends)))
        each = _Pressing(moments.force, *moments.centre_of_pressure)
        if moments.force_is_bound or moments.centre_of_pressure_is_bound or not all(map(math.isfinite, each)):
            return None
        found.append(each)
    return found
