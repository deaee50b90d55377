"""Pressure under a rigid flat punch: low in the middle, high at the rim.

As a sum of uniform pressures on the outline and on a smaller one about the same centre. How much smaller, and the
pressures, are the closest to what contact mechanics computes for the five shapes with edges of any rounding
(synthetic/, training seeds).
"""

import numpy as np

from tactile_node.geometry.outlines import Outline
from tactile_node.read_only import read_only

SIZES = read_only(np.array((1.0, 0.85)))  #: of the outlines, relative
STEPS = read_only(np.array((1.90, -1.27)))  #: of the pressure from one outline to the next, its mean about 1
#: Weights of the outlines: of a uniform pressure, and of what a punch's differs from it.
PROFILES = read_only(np.array(((1.0, 0.0), STEPS - (1.0, 0.0))))


def nested(outline: Outline, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the outlines of SIZES, (k, n, 2), and d corners / d parameters, (p, k, n, 2)."""
    corners, motions = outline.moving(parameters)
    size = SIZES[:, np.newaxis, np.newaxis]
    centre = parameters[:2]
    smaller = motions[:, np.newaxis] * size
    smaller[0, :, :, 0] = smaller[1, :, :, 1] = 1
    return centre + size * (corners - centre), smaller
