"""Describe rigid indenters as gap surfaces: flat punches with rounded edges, balls, cylinders on their side and cones.

Lengths are in units of the square root of the nominal contact area, and pressures in units of the contact modulus E*. A
half-space has no length scale, so one solution holds for every size. The ``compression`` of an indenter is its mean
pressure divided by E*. At a compression of 0.1, a soft skin wraps around a rounded edge. At a compression of 0.01, a
stiff skin touches only the flat part.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from tactile_node.pose.outlines import OUTLINES, edges_of
from tactile_node.simulator.world import Contact

#: Size of the grid relative to the analytical contact, for indenters without a silhouette.
ROOM = 1.2
OUTLINE_POINTS = 64  #: Number of points on the outline of a circle.


@dataclass(frozen=True)
class Indenter:
    """One indenter. The load is the nominal area times ``compression``."""

    kind: str             #: 'flat_punch', 'ball', 'cylinder' or 'cone'
    label: str            #: shape of the contact, one of world.CLASSES
    compression: float    #: mean pressure over the nominal area, in units of E*

    #: function that returns the gap at x, y; the gap is infinite outside the silhouette
    gap: Callable[[np.ndarray, np.ndarray], np.ndarray]
    low: tuple[float, float]   #: lower corner (x, y) of the rectangle that contains the contact
    high: tuple[float, float]
    outline: np.ndarray   #: nominal outline of the contact, (n, 2), about the origin


def flat_punch(contact: Contact, compression: float, rounding: float = 0.0) -> Indenter:
    """Return a prism whose face is ``contact`` (area 1, at the origin), with edges rounded to a quarter circle.

    The ratio ``rounding`` is the radius of the edges divided by the face's inscribed radius, from 0 (sharp) to 1.
    """
    radius, outline = rounding * inscribed_radius(contact), contact.outline(OUTLINE_POINTS)

    def gap(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        depth = contact.depth(x, y)
        inset = np.clip(radius - depth, 0, radius)
        return np.where(depth < 0, np.inf, radius - np.sqrt(radius ** 2 - inset ** 2))
    return Indenter('flat_punch', contact.shape, compression, gap, low=_pair(outline.min(0)),
                    high=_pair(outline.max(0)), outline=outline)


def ball(compression: float) -> Indenter:
    """Return a ball, approximated by a paraboloid.

    According to Hertz, the contact has the area 1 if a³ = 3 P R / (4 E*).
    """
    a = 1 / sqrt(pi)
    radius = 4 * a ** 3 / (3 * compression)
    return _round('ball', compression, lambda r: r ** 2 / (2 * radius), a)


def cone(compression: float, tip: float = 0.0) -> Indenter:
    """Return a cone whose tip is pressed into the surface.

    According to Sneddon (1948), the contact has the area 1 if P = π a² E* slope / 2.

    The length ``tip`` is the radius of the paraboloid that replaces the tip [fraction of the contact's radius]. At this
    radius, the paraboloid has the slope of the cone.
    """
    a, slope = 1 / sqrt(pi), 2 * compression

    def profile(r: np.ndarray) -> np.ndarray:
        blunt = tip * a
        return slope * np.where(r < blunt, (r * r / blunt + blunt) / 2 if blunt else r, r)
    return _round('cone', compression, profile, a)


def cylinder(compression: float, ratio: float, rounding: float = 0.0) -> Indenter:
    """Return a cylinder with its axis along x.

    The contact of the cylinder has the area 1 and is ``ratio`` times as long as wide.

    The radius of the cylinder follows from Hertz's line contact, b² = 4 P R / (π E* length). The ratio ``rounding`` is
    the radius of the edges at both ends divided by the contact's half-width. Sharp ends (0) make the contact wider at
    both ends.
    """
    length, half_width = sqrt(ratio), 1 / sqrt(ratio) / 2
    radius, edge = pi * half_width / (8 * compression), rounding * half_width

    def gap(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        depth = length / 2 - np.abs(x)
        inset = np.clip(edge - depth, 0, edge)
        return np.where(depth < 0, np.inf, y * y / (2 * radius) + edge - np.sqrt(edge ** 2 - inset ** 2))
    outline = OUTLINES['rectangle'].placed(np.zeros(2), 0.0, np.array((length, 2 * half_width)))
    reach = (length / 2, 1.6 * half_width)
    return Indenter('cylinder', 'rectangle', compression, gap, low=(-reach[0], -reach[1]), high=reach, outline=outline)


def inscribed_radius(contact: Contact) -> float:
    """Return the radius of the largest circle inside ``contact``.

    The radius is half of the short side, or 2 area / perimeter.
    """
    if contact.shape == 'circle':
        return contact.dimensions[0]
    if contact.shape in ('square', 'rectangle'):
        return min(contact.dimensions) / 2
    return float(2 * contact.area / edges_of(contact.outline()).length.sum())


def _round(kind: str, compression: float, profile: Callable[[np.ndarray], np.ndarray], a: float) -> Indenter:
    reach, outline = ROOM * a, Contact('circle', (a,), x=0.0, y=0.0).outline(OUTLINE_POINTS)
    return Indenter(kind, 'circle', compression, lambda x, y: profile(np.hypot(x, y)), low=(-reach, -reach),
                    high=(reach, reach), outline=outline)


def _pair(corner: np.ndarray) -> tuple[float, float]:
    return float(corner[0]), float(corner[1])
