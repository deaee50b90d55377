"""What the model of a punch leaves out, by shape: corners that carry less, edges of unknown rounding.

Found on computed contacts of training seeds (bench/bench_pose.py --calibrate), in the shape's own frame: place in
inscribed radii, angle in radians, dimensions relative. A uniform pressure has none of it, a punch all.
"""

from typing import NamedTuple

import numpy as np

from tactile_node.geometry.outlines import outline_of
from tactile_node.shape.recognition import Shape

MOST = 1.2  #: of a punch's peak
#: Standard deviations that no fit goes below: taxels differ from the model's, and a layer from a half-space.
LEAST_PLACE, LEAST_ANGLE, LEAST_LENGTH = 0.003, 0.001, 0.02  #: [pitches, radians]
FEW = 20.0  #: area [taxels] at which the deviation is twice that of large contacts


class ModelError(NamedTuple):
    """Of x, y, angle (but a circle's) and the dimensions."""

    bias: tuple[float, ...]       #: under a punch
    of_size: tuple[float, ...]    #: and so much more of it at an inscribed radius of one pitch, less in proportion
    of_ratio: tuple[float, ...]   #: and so much for a logarithm of 1 of the two dimensions' ratio
    deviation: tuple[float, ...]  #: standard deviation about that


ERRORS = {
    Shape.CIRCLE: ModelError((0, 0, -0.017), (0, 0, 0.015), (0, 0, 0), (0.005, 0.005, 0.017)),
    Shape.SQUARE: ModelError((0, 0, 0, -0.021), (0, 0, 0, 0.046), (0, 0, 0, 0), (0.005, 0.005, 0.006, 0.019)),
    Shape.RECTANGLE: ModelError((0, 0, 0, -0.004, -0.046), (0, 0, 0, -0.009, 0.035), (0, 0, 0, 0.007, 0.066),
                                (0.006, 0.005, 0.004, 0.013, 0.023)),
    Shape.RIGHT_TRIANGLE: ModelError((-0.053, 0.015, -0.002, -0.019, -0.021), (0.124, -0.016, 0.005, 0.090, 0.125),
                                     (0.054, -0.016, -0.004, 0.014, -0.021), (0.023, 0.012, 0.006, 0.013, 0.021)),
    Shape.ISOSCELES_TRIANGLE: ModelError((0, 0, 0, -0.029, -0.027), (0, 0.032, 0, 0.103, 0.109),
                                         (0, -0.020, 0, 0.005, -0.005), (0.006, 0.019, 0.004, 0.017, 0.016)),
}


def corrected(shape: Shape, handedness: int, parameters: np.ndarray, covariance: np.ndarray,
              peak: float) -> tuple[np.ndarray, np.ndarray]:
    """Return parameters [pitches] and covariance of a fit that found ``peak``, without what punches add to it."""
    outline, error, share = outline_of(shape, handedness), ERRORS[shape], min(max(peak, 0.0), MOST)
    area, radius = _area_and_radius(outline.corners(parameters))
    _, angle, dimensions = outline.split(parameters)
    to_pad = np.diag((radius, radius, *([1.0] if outline.symmetry else []), *dimensions))
    cos, sin = np.cos(angle), np.sin(angle)
    to_pad[:2, :2] = radius * np.array(((cos, -sin), (sin, cos)))
    ratio = float(np.log(dimensions[0] / dimensions[-1]))
    bias = share * (np.array(error.bias) + np.array(error.of_size) / radius + np.array(error.of_ratio) * ratio)
    if shape is Shape.RIGHT_TRIANGLE:
        bias[1:3] *= handedness
    deviation = share * (1 + (FEW / area) ** 2) * np.array(error.deviation)
    least = np.concatenate(([LEAST_PLACE] * 2, [LEAST_ANGLE] * (len(parameters) - 2 - len(dimensions)),
                            [LEAST_LENGTH] * len(dimensions)))
    systematic = to_pad @ np.diag(deviation ** 2) @ to_pad.T + np.diag(least ** 2)
    return parameters - to_pad @ bias, covariance + systematic


def _area_and_radius(corners: np.ndarray) -> tuple[float, float]:
    """Area, and 2 area / perimeter: the radius of the inscribed circle, but a rectangle's."""
    following = np.roll(corners, -1, axis=0)
    area = abs((corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]).sum()) / 2
    return float(area), float(2 * area / np.hypot(*(following - corners).T).sum())
