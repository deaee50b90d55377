"""Pressure under a rigid flat punch: low in the middle, high at the rim.

As a sum of uniform pressures on outlines inside each other, each moved inwards by a part of the inscribed radius. The
parts and their pressures are the closest to what contact mechanics computes for the five shapes with edges of any
rounding (synthetic/, training seeds; bench/bench_pose.py --profile).
"""

import numpy as np

from tactile_node.geometry.outlines import Outline
from tactile_node.read_only import read_only

INSETS = read_only(np.array((0.0, 0.1, 0.3)))       #: of the inscribed radius
#: Of the pressure from one outline to the next, its mean about 1; by the names of an outline's dimensions.
STEPS = {
    ('radius',): (2.10, -1.13, -0.38), ('side',): (2.21, -1.27, -0.36), ('long', 'short'): (2.40, -1.20, -0.58),
    ('long_leg', 'short_leg'): (2.31, -1.40, -0.36), ('base', 'height'): (2.23, -1.31, -0.37)}


def profiles(outline: Outline) -> np.ndarray:
    """Weights of the outlines, (2, k): of a uniform pressure, and of what a punch's differs from it."""
    uniform = np.array((1.0, 0.0, 0.0))
    return np.array((uniform, STEPS[outline.dimensions] - uniform))


def nested(outline: Outline, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the outlines moved inwards by INSETS, (k, n, 2).

    And their derivatives by the parameters, (p, k, n, 2).
    """
    corners, motions = outline.moving(parameters)
    inwards, changes = _inwards(outline, parameters, corners, motions)
    part = INSETS[:, np.newaxis, np.newaxis]
    return corners - part * inwards, motions[:, np.newaxis] - part * changes[:, np.newaxis]


def _inwards(outline: Outline, parameters: np.ndarray, corners: np.ndarray,
             motions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far each corner moves when all sides move inwards by the inscribed radius, (n, 2), and its derivatives."""
    if len(corners) == 3:
        middle, change = _incentre(corners, motions)
        return corners - middle, motions - change[:, np.newaxis]
    if outline.dimensions != ('long', 'short'):
        return corners - parameters[:2], motions - motions.mean(1, keepdims=True)
    short = parameters[4]
    square, turned = outline.moving(np.array((0.0, 0.0, parameters[2], short, short)))
    changes = np.zeros_like(motions)
    changes[2], changes[4] = turned[2], square / short
    return square, changes


def _incentre(corners: np.ndarray, motions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The centre of a triangle's inscribed circle, (2,), and its derivatives, (p, 2)."""
    one, other = corners[[1, 2, 0]], corners[[2, 0, 1]]
    length = np.hypot(*(one - other).T)
    around = length.sum()
    middle = length @ corners / around
    longer = ((motions[:, [1, 2, 0]] - motions[:, [2, 0, 1]]) * ((one - other) / length[:, np.newaxis])).sum(2)
    moved = longer @ corners + np.einsum('k,pkx->px', length, motions)
    return middle, (moved - np.outer(longer.sum(1), middle)) / around
