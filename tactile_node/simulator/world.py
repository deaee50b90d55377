"""Synthetic contacts of five shapes in general position, which serve as the ground truth for the reported results.

Lengths and positions are in taxel pitches. Taxel (row, col) is centred at x = col, y = row. A positive angle rotates x
towards y. In general position, the angle is uniformly distributed over the full circle, and the centre of area is
uniformly distributed within one taxel in the middle of the pad. Areas are given in taxels. The shapes of the benchmark
are:

- circle
- square
- rectangle, with a ratio of sides uniform from 1.5 to 3
- right triangle of either handedness, with a ratio of legs uniform from 1.5 to 2.5
- isosceles triangle, with an apex angle uniform from 40 to 75 degrees
"""

from dataclasses import dataclass

import numpy as np

from tactile_node.pose.outlines import OUTLINES, Outline, depth_inside, outline_of
from tactile_node.shape.recognition import SHAPES

CLASSES = tuple(shape.value for shape in SHAPES)  #: names of the shapes that touch the pad
PAD = 36  #: number of rows and columns of the benchmark pad


@dataclass(frozen=True)
class Contact:
    """One contact: its shape, size, position and angle.

    Attributes
    ----------
    shape
        One of CLASSES.
    dimensions
        Lengths [pitches] that depend on the shape. circle: (radius,). square: (side,). rectangle: (long side, short
        side). right_triangle: (leg along x, leg along y, handedness), where handedness is +1, or -1 if mirrored.
        isosceles_triangle: (base, height).
    x, y
        Centre of area [pitches].
    angle
        Rotation from x towards y [rad].
    """

    shape: str
    dimensions: tuple[float, ...]
    x: float
    y: float
    angle: float = 0.0

    @property
    def area(self) -> float:
        """Area of the contact [taxels]."""
        a, b = self.dimensions[0], self.dimensions[min(1, len(self.dimensions) - 1)]
        return {'circle': np.pi * a * a, 'square': a * a, 'rectangle': a * b}.get(self.shape, a * b / 2)

    @property
    def reach(self) -> float:
        """Distance from the centre of area to the farthest point of the contact [pitches]."""
        if self.shape == 'circle':
            return self.dimensions[0]
        corners = self._outline(0).placed(np.zeros(2), 0.0, self._lengths)
        return float(np.hypot(*corners.T).max())

    @property
    def handedness(self) -> int:
        """Handedness of a right triangle: 1, or -1 if mirrored. All other shapes have handedness 1."""
        return int(self.dimensions[2]) if self.shape == 'right_triangle' else 1

    def outline(self, points: int = 64) -> np.ndarray:
        """Return the vertices of the outline.

        Parameters
        ----------
        points
            Number of vertices of the polygon that approximates a circle.

        Returns
        -------
        numpy.ndarray
            Vertices (x, y), ordered in the direction from x towards y, shape (n, 2).
        """
        return self._outline(points).placed(np.array((self.x, self.y)), self.angle, self._lengths)

    def depth(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the signed distance of points from the outline [pitches], positive inside.

        The distance is exact inside and near an edge.
        """
        if self.shape == 'circle':
            return self.dimensions[0] - np.hypot(x - self.x, y - self.y)
        return depth_inside(self.outline(), x, y)

    def pattern(self, rows: int = PAD, cols: int = PAD) -> np.ndarray:
        """Return the on/off pattern, bool, shape (rows, cols). A taxel is active if its centre is inside."""
        y, x = np.indices((rows, cols), float)
        return self.depth(x, y) >= 0

    @property
    def _lengths(self) -> np.ndarray:
        return np.array(self.dimensions[:len(OUTLINES[self.shape].dimensions)])

    def _outline(self, points: int) -> Outline:
        if self.shape != 'circle':
            return outline_of(self.shape, self.handedness)
        angle = np.arange(points) * (2 * np.pi / points)
        return OUTLINES['circle']._replace(template=np.stack((np.cos(angle), np.sin(angle)), 1)[..., np.newaxis])


def random_contact(rng: np.random.Generator, shape: str, area: float,
                   rows: int = PAD, cols: int = PAD) -> Contact:
    """Draw a random contact in general position, in the middle of a pad.

    Parameters
    ----------
    rng
        Random generator for the position, angle and ratio.
    shape
        One of CLASSES.
    area
        Area of the contact [taxels].
    rows, cols
        Size of the pad.

    Examples
    --------
    >>> random_contact(np.random.default_rng(1), 'square', 49).dimensions
    (7.0,)
    """
    dimensions = _dimensions(rng, shape, area)
    x, y = rng.uniform(-0.5, 0.5, 2) + ((cols - 1) / 2, (rows - 1) / 2)
    return Contact(shape, dimensions, x=float(x), y=float(y), angle=float(rng.uniform(0, 2 * np.pi)))


def _dimensions(rng: np.random.Generator, shape: str, area: float) -> tuple[float, ...]:
    if shape == 'circle':
        return (float(np.sqrt(area / np.pi)),)
    if shape == 'square':
        return (float(np.sqrt(area)),)
    if shape == 'rectangle':
        ratio = rng.uniform(1.5, 3)
        return (float(np.sqrt(area * ratio)), float(np.sqrt(area / ratio)))
    if shape == 'right_triangle':
        ratio, handedness = rng.uniform(1.5, 2.5), float(rng.choice((-1.0, 1.0)))
        return (float(np.sqrt(2 * area * ratio)), float(np.sqrt(2 * area / ratio)), handedness)
    if shape == 'isosceles_triangle':
        slope = 2 * np.tan(np.radians(rng.uniform(40, 75)) / 2)  # base / height
        return (float(np.sqrt(2 * area * slope)), float(np.sqrt(2 * area / slope)))
    raise ValueError(f'{shape!r} is not one of {", ".join(CLASSES)}')
