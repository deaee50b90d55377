"""The outlines of the five shapes as functions of few parameters: what is fitted, and what contacts are drawn from.

The origin of a shape's own frame is its centre of area; positive angles rotate x towards y. Shapes go by their
names, which are the values of `shape.recognition.Shape`.
"""

from typing import NamedTuple

import numpy as np

CIRCLE_CORNERS = 32  #: a circle is a polygon of the same area


class Outline(NamedTuple):
    """Polygons linear in their dimensions: corner i is ``template[i] @ dimensions``, then rotated by the angle."""

    dimensions: tuple[str, ...]  #: their names
    template: np.ndarray         #: shape (corners, 2, len(dimensions)), in the sense from x to y
    symmetry: int                #: a rotation by 2π/symmetry changes nothing; 0: by any angle

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of what is fitted: the place, the angle if it has one, the dimensions."""
        return ('x', 'y', *(('angle',) if self.symmetry else ()), *self.dimensions)

    def split(self, parameters: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        """Return centre (2,), angle and dimensions of ``parameters``."""
        if not self.symmetry:
            return parameters[:2], 0.0, parameters[2:]
        return parameters[:2], float(parameters[2]), parameters[3:]

    def corners(self, parameters: np.ndarray) -> np.ndarray:
        """Return the corners, shape (corners, 2)."""
        return self.placed(*self.split(parameters))

    def placed(self, centre: np.ndarray, angle: float, dimensions: np.ndarray) -> np.ndarray:
        """Return the corners, shape (corners, 2), of an outline at ``centre`` (2,)."""
        corners: np.ndarray = self.template @ dimensions @ _rotation(angle) + centre
        return corners

    def moving(self, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners and d corners / d parameters, shape (parameters, corners, 2)."""
        corners, motions = self.moving_nested(parameters, np.ones((1, len(self.dimensions))))
        return corners[0], motions[:, 0]

    def moving_nested(self, parameters: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the same of k outlines within each other, (k, corners, 2) and (parameters, k, corners, 2).

        ``sizes``, (k, dimensions): of each, relative to those of ``parameters``.
        """
        centre, angle, dimensions = self.split(parameters)
        by_dimension = self.template.transpose(2, 0, 1) @ _rotation(angle)
        motions = np.zeros((len(parameters), len(sizes), len(self.template), 2))
        motions[0, :, :, 0] = motions[1, :, :, 1] = 1
        np.multiply(sizes.T[:, :, np.newaxis, np.newaxis], by_dimension[:, np.newaxis], out=motions[-len(dimensions):])
        arms = (sizes * dimensions) @ by_dimension.reshape(len(dimensions), -1)
        arms = arms.reshape(motions.shape[1:])
        if self.symmetry:
            np.negative(arms[..., 1], out=motions[2, ..., 0])
            motions[2, ..., 1] = arms[..., 0]
        return arms + centre, motions


def outline_of(shape: str, handedness: int = 1) -> Outline:
    """Return the outline of one of the five shapes; ``handedness`` (1 or -1, mirrored) is the right triangle's.

    >>> outline_of('rectangle').parameters
    ('x', 'y', 'angle', 'long', 'short')
    """
    if shape == 'right_triangle' and handedness < 0:
        return _MIRRORED
    return OUTLINES[shape]


def polygon_in_circle(corners: int) -> Outline:
    """Return a circle's outline as a regular polygon with its corners on the circle: for drawing."""
    angle = np.arange(corners) * (2 * np.pi / corners)
    return OUTLINES['circle']._replace(template=np.stack((np.cos(angle), np.sin(angle)), 1)[..., np.newaxis])


def _rotation(angle: float) -> np.ndarray:
    """Rotation matrix for row vectors."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array(((cos, sin), (-sin, cos)))


def _template(*corners: tuple[tuple[float, ...], tuple[float, ...]]) -> np.ndarray:
    """Of corners given as ((x by dimension), (y by dimension))."""
    template = np.array(corners, float)
    template.flags.writeable = False
    return template


def _circle() -> np.ndarray:
    angle = np.arange(CIRCLE_CORNERS) * (2 * np.pi / CIRCLE_CORNERS)
    same_area = np.sqrt(2 * np.pi / CIRCLE_CORNERS / np.sin(2 * np.pi / CIRCLE_CORNERS))
    return _template(*(((same_area * np.cos(a),), (same_area * np.sin(a),)) for a in angle))


#: by the shape's name
OUTLINES: dict[str, Outline] = {
    'circle': Outline(('radius',), _circle(), 0),
    'square': Outline(('side',), _template(
        ((-.5,), (-.5,)), ((.5,), (-.5,)), ((.5,), (.5,)), ((-.5,), (.5,))), 4),
    'rectangle': Outline(('long', 'short'), _template(
        ((-.5, 0), (0, -.5)), ((.5, 0), (0, -.5)), ((.5, 0), (0, .5)), ((-.5, 0), (0, .5))), 2),
    'right_triangle': Outline(('long_leg', 'short_leg'), _template(
        ((-1 / 3, 0), (0, -1 / 3)), ((2 / 3, 0), (0, -1 / 3)), ((-1 / 3, 0), (0, 2 / 3))), 1),
    'isosceles_triangle': Outline(('base', 'height'), _template(
        ((-.5, 0), (0, -1 / 3)), ((.5, 0), (0, -1 / 3)), ((0, 0), (0, 2 / 3))), 1),
}
_MIRRORED = OUTLINES['right_triangle']._replace(template=_template(
    ((-1 / 3, 0), (0, 1 / 3)), ((-1 / 3, 0), (0, -2 / 3)), ((2 / 3, 0), (0, 1 / 3))))
