"""Messages for viewers: markers for a contact and its shape, images of the taxels, and a wrench for the pressures.

Every marker message contains the same set of markers, each in a separate namespace and with the ID 0. Each message adds
the markers that have something to draw, and deletes the others. A viewer therefore never keeps a marker of an earlier
message, even if the viewer has missed messages. All markers of a message are in the pad frame and come from one taxel
frame, so an outline is never drawn over newer taxels.

Row 0 of an image is row 0 of the pad. A viewer draws row 0 at the top, so the pad's y axis points down and its z axis
points away from the user. The image therefore shows the pad from behind, as seen from inside the finger.
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
from tactile_node.contact.neighbours import grown
from tactile_node.contact.pattern import MOST_LABELS, of_contact
from tactile_node.contact.visibility import visibility_of
from tactile_node.pose.moments import contact_moments
from tactile_node.pose.pipeline import FoundContact
from tactile_node.ros.contact_messages import PadContact, PadFrame, as_array, without_left_over
from tactile_node.ros.shape_messages import fitted_angle
from tactile_node.ros.time_messages import duration_message, seconds
from tactile_node.shape.recognition import UnknownReason
from tactile_node.taxel_frame import ON_OFF_UNIT, TaxelStatus
from tactile_skin.msg import ContactShape

WHOLE_COLOUR = ColorRGBA(r=0.16, g=0.9, b=1.0, a=1.0)  #: cyan, for a fitted contact that is completely visible

#: orange, for the visible part of a contact that may extend further (*_is_bound)
BOUND_COLOUR = ColorRGBA(r=1.0, g=0.6, b=0.0, a=1.0)
TEXT = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)
X_AXIS = ColorRGBA(r=1.0, g=0.2, b=0.2, a=1.0)
Y_AXIS = ColorRGBA(r=0.3, g=0.5, b=1.0, a=1.0)
TAXEL = 0.9        #: drawn side length of a taxel [pitches]
THICKNESS = 0.2    #: drawn thickness of a taxel [pitches]
LINE_WIDTH = 0.25  #: drawn width of a line [pitches]
ABOVE = 0.15       #: height at which lines are drawn above the skin [pitches]
DOT = 0.8          #: diameter of the dot at the centre of pressure [pitches]
LETTER = 1.5       #: height of the letters [pitches]
SHORTEST_LIFETIME = 0.5  #: shortest lifetime of a marker [s], so that a viewer does not flicker after a short delay
LONGEST_LIFETIME = 30.0  #: longest lifetime of a marker [s], which is three periods of the slowest SYNC
PERIODS = 3.0   #: lifetime of a marker [intervals between messages]
VALUES = '32FC1'  #: encoding from sensor_msgs/image_encodings.hpp
COLOURS = 'rgb8'  #: encoding from sensor_msgs/image_encodings.hpp


class ContactMarkers:
    """Creates the markers of one pad: `taxels`, `outline`, `axes`, `centre_of_pressure` and `name`."""

    def __init__(self, scale: ColourScale):
        self._scale = scale
        self._palette = [ColorRGBA(r=r, g=g, b=b, a=1.0) for r, g, b in (RGB_TABLE / 255.0).tolist()]
        self._grid: tuple[int, int, float] | None = None
        self._centres: list[Point] = []  # taxel centres of _grid, kept because their creation takes most of the time

    def message(self, contact: PadContact, shape: ContactShape, lifetime: float) -> MarkerArray:
        """Return the markers of a contact.

        Parameters
        ----------
        contact
            Contact to draw.
        shape
            Shape recognised from the contact.
        lifetime
            Lifetime of the markers [s].
        """
        pitch = contact.frame.taxels.pitch
        found = {'taxels': self._taxels(without_left_over(contact)), 'outline': _outline(shape, pitch),
                 'axes': _axes(shape, pitch), 'centre_of_pressure': _centre_of_pressure(shape, pitch),
                 'name': _name(shape, contact.frame)}
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

    def _taxels(self, frame: PadFrame) -> Marker | None:
        """Return all taxels of the pad in the colours of their values, with their tops at the surface of the skin."""
        numbers = _colour_numbers(frame, self._scale)
        places = np.flatnonzero(frame.status != TaxelStatus.UNMAPPED).tolist()
        if not places:
            return None
        pitch = frame.taxels.pitch
        centres, palette = self._centres_of(frame), self._palette
        colours = numbers.reshape(-1).tolist()
        marker = _marker(Marker.CUBE_LIST, TAXEL * pitch, TAXEL * pitch, THICKNESS * pitch)
        marker.color = TEXT  # the message requires this colour, but each taxel has its own
        marker.points = [centres[place] for place in places]
        marker.colors = [palette[colours[place]] for place in places]
        return marker

    def _centres_of(self, frame: PadFrame) -> list[Point]:
        (rows, cols), pitch = frame.values.shape, frame.taxels.pitch
        grid = rows, cols, pitch
        if grid != self._grid:
            below = -THICKNESS / 2 * pitch
            self._centres = [Point(x=col * pitch, y=row * pitch, z=below) for row in range(rows) for col in range(cols)]
            self._grid = grid
        return self._centres


def _outline(shape: ContactShape, pitch: float) -> Marker | None:
    """Return the fitted outline as a closed line, or None if there is no fit."""
    if not shape.fit_valid or not shape.outline.points:
        return None
    marker = _marker(Marker.LINE_STRIP, LINE_WIDTH * pitch)
    marker.color = BOUND_COLOUR if shape.size_is_bound else WHOLE_COLOUR
    corners = [_above(pitch, corner.x, corner.y) for corner in shape.outline.points]
    marker.points = [*corners, corners[0]]
    return marker


def _axes(shape: ContactShape, pitch: float) -> Marker | None:
    """Return the shape's own x axis (red) and y axis (blue) from its centre, or None for a circle."""
    if not shape.fit_valid or not shape.symmetry:
        return None
    angle, place = fitted_angle(shape), shape.pose.pose.position
    length = max(shape.dimensions) / 2
    x, y = length * math.cos(angle), length * math.sin(angle)
    centre = _above(pitch, place.x, place.y)
    marker = _marker(Marker.LINE_LIST, LINE_WIDTH * pitch)
    marker.color = TEXT  # the message requires this colour, but each point has its own
    marker.points = [centre, _above(pitch, centre.x + x, centre.y + y),
                     centre, _above(pitch, centre.x - y, centre.y + x)]
    marker.colors = [X_AXIS, X_AXIS, Y_AXIS, Y_AXIS]
    return marker


def _centre_of_pressure(shape: ContactShape, pitch: float) -> Marker | None:
    centre = shape.centre_of_pressure
    if not (math.isfinite(centre.x) and math.isfinite(centre.y)):
        return None
    marker = _marker(Marker.SPHERE, *(DOT * pitch,) * 3)
    marker.color = BOUND_COLOUR if shape.centre_of_pressure_is_bound else WHOLE_COLOUR
    marker.pose.position = Point(x=centre.x, y=centre.y)
    return marker


def _name(shape: ContactShape, frame: PadFrame) -> Marker:
    """Return a text marker with the class and its probability beyond the last row, even for an empty or unseen pad."""
    (rows, cols), pitch = frame.values.shape, frame.taxels.pitch
    marker = _marker(Marker.TEXT_VIEW_FACING, height=LETTER * pitch)
    marker.color = TEXT
    marker.pose.position = Point(x=(cols - 1) / 2 * pitch, y=(rows + LETTER) * pitch)
    marker.text = _words(shape)
    return marker


def _words(shape: ContactShape) -> str:
    name = shape.class_name.replace('_', ' ')
    if shape.shape == ContactShape.UNKNOWN:
        name += f' ({UnknownReason(shape.unknown_reason).name.lower().replace("_", " ")})'
    return f'{name} {shape.confidence:.0%}'


def _marker(kind: int, width: float = 0.0, depth: float = 0.0, height: float = 0.0) -> Marker:
    """Return a marker at the origin of the pad frame. RViz ignores components of the marker's scale that are 0."""
    return Marker(type=kind, action=Marker.ADD, scale=Vector3(x=width, y=depth, z=height),
                  pose=Pose(orientation=Quaternion(w=1.0)))


def _above(pitch: float, x: float, y: float) -> Point:
    """Return one point of a line [m]. The point lies above the skin, so that the taxels do not hide the line."""
    return Point(x=float(x), y=float(y), z=ABOVE * pitch)


class MarkerLifetime:
    """Computes the lifetime of markers from the time between messages.

    A viewer measures lifetimes by its own clock, which is the clock of the log in a replay with use_sim_time, otherwise
    the steady clock. An interval is therefore measured on both clocks, and the longer value is used. The lifetime
    follows the shorter of the last two intervals, so that an outage does not prolong the lifetime of later markers.
    """

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None
        self._gaps: deque[float] = deque(maxlen=2)

    def after(self, steady: float, stamp: float) -> float:
        """Return the lifetime of markers for a message with ``stamp`` that is sent at ``steady``, all in [s]."""
        if self._last is not None:
            self._gaps.append(max(steady - self._last[0], stamp - self._last[1]))
        self._last = steady, stamp
        gap = min(self._gaps, default=0.0)
        return min(max(SHORTEST_LIFETIME, PERIODS * gap), LONGEST_LIFETIME) if math.isfinite(gap) else SHORTEST_LIFETIME


def value_image(frame: PadFrame) -> Image:
    """Return the taxel values as an image [unit of the taxels].

    NaN means no valid value, and a saturated value is a lower bound.
    """
    rows, cols = frame.values.shape
    return Image(header=frame.header, height=rows, width=cols, encoding=VALUES, is_bigendian=sys.byteorder == 'big',
                 step=4 * cols, data=array('B', frame.values.tobytes()))


def colour_image(frame: PadFrame, scale: ColourScale) -> Image:
    """Return the taxel values as an image in the colours of ``scale``."""
    rows, cols = frame.values.shape
    return Image(header=frame.header, height=rows, width=cols, encoding=COLOURS, is_bigendian=False, step=3 * cols,
                 data=as_array('B', RGB_TABLE[_colour_numbers(frame, scale)], np.uint8))


def _colour_numbers(frame: PadFrame, scale: ColourScale) -> np.ndarray:
    return scale.numbers(frame.values, frame.status == TaxelStatus.SATURATED, frame.taxels.unit or '',
                         seconds(frame.header.stamp))


class _Pressing(NamedTuple):
    force: float  # [N]
    x: float      # centre of the force [m]
    y: float


def wrench_message(contact: PadContact) -> WrenchStamped:
    """Return the wrench that all contacts exert on the pad, about the origin of the pad frame.

    The z axis points out of the skin, so a pressing object has force.z < 0. A force F at (x, y) has the torque (-y F, x
    F, 0). Pressures do not measure forces along x and y or a torque about z, so these components are 0 even if there is
    shear. All six components are NaN if the force is not known, because taxels are saturated or on/off, or because
    taxels are hidden where something may press.
    """
    pressing = _known(contact.found)
    wrench = Wrench(force=Vector3(), torque=Vector3())
    if pressing is None:
        for part in (wrench.force, wrench.torque):
            part.x = part.y = part.z = math.nan
    else:
        wrench.force.z = 0.0 - sum(each.force for each in pressing)
        wrench.torque.x = 0.0 - sum(each.force * each.y for each in pressing)
        wrench.torque.y = 0.0 + sum(each.force * each.x for each in pressing)
    return WrenchStamped(header=contact.header, wrench=wrench)


def _known(contact: FoundContact) -> list[_Pressing] | None:
    """Return the force and the centre of each contact, or None if any contact is not completely known.

    A taxel that is next to two contacts counts for the first one, as in `FoundContact.pad_force`.
    """
    pattern, visibility, taxels, smallest_contact = contact
    if not visibility.pad_seen or taxels.unit == ON_OFF_UNIT or pattern.contacts > MOST_LABELS:
        return None
    found = []
    counted = np.zeros(pattern.mask.shape, bool)
    for number in range(1, pattern.contacts + 1):
        part = of_contact(pattern, number)
        values = np.where(counted & ~part.mask, 0.0, part.values)
        counted |= grown(part.mask)
        moments = contact_moments(values, part.mask, taxels.pitch, taxels.unit or '',
                                  visibility_of(part, smallest_contact, taxels.finger_ends))
        each = _Pressing(moments.force, *moments.centre_of_pressure)
        if moments.force_is_bound or moments.centre_of_pressure_is_bound or not all(map(math.isfinite, each)):
            return None
        found.append(each)
    return found
