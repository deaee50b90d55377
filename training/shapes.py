"""Provide building blocks of figures: parts of a grid of points, as bool arrays."""

from collections.abc import Callable

import numpy as np

#: Function that draws a figure. Its arguments are a generator and the arrays x and y, and it returns a bool array of
#: their shape.
Figure = Callable[[np.random.Generator, np.ndarray, np.ndarray], np.ndarray]


def disc(x, y, radius, x0=0.0, y0=0.0):
    return np.hypot(x - x0, y - y0) <= radius


def box(x, y, x0, x1, y0, y1):
    return (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)


def inside(x, y, corners):
    """Return the points inside a polygon, determined by the parity of the crossed edges. The polygon need not be
    convex."""
    found = np.zeros(x.shape, bool)
    for (xa, ya), (xb, yb) in zip(corners, np.roll(corners, -1, axis=0)):
        if ya != yb:
            found ^= ((ya > y) != (yb > y)) & (x < xa + (y - ya) * (xb - xa) / (yb - ya))
    return found


def stroke(x, y, points, width):
    """Return the points within half a ``width`` of a line through ``points``."""
    found = np.zeros(x.shape, bool)
    for (xa, ya), (xb, yb) in zip(points, points[1:]):
        dx, dy = xb - xa, yb - ya
        along = np.clip(((x - xa) * dx + (y - ya) * dy) / max(dx * dx + dy * dy, 1e-9), 0, 1)
        found |= np.hypot(x - xa - along * dx, y - ya - along * dy) <= width / 2
    return found


def polar(corners, middle=(0.0, 0.0)):
    angle, radius = np.array(corners).T
    return np.column_stack((middle[0] + radius * np.cos(angle), middle[1] + radius * np.sin(angle)))
