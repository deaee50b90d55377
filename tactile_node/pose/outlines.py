"""Outlines of the five shapes as functions of a few parameters, for fitting and drawing contacts.

The origin of a shape's own frame is the shape's centre of area. Positive angles rotate x towards y. The names of the
shapes are the values of `shape.recognition.Shape`.
"""

from typing import NamedTuple

import numpy as np

CIRCLE_CORNERS = 32    #: Number of corners of the polygon that replaces a circle of equal area.
LEAST_DIMENSION = 0.3  #: Smallest value of a fitted dimension [pitches].


class Outline(NamedTuple):
    """A polygon whose corners are linear functions of its dimensions.

    Corner i is ``template[i] @ dimensions``, rotated by the angle.
    """

    dimensions: tuple[str, ...]  #: names of the dimensions
    template: np.ndarray         #: (corners, 2, len(dimensions)), with corners ordered by rotation from x to y
    symmetry: int                #: the shape looks the same after a rotation by 2π/symmetry; 0 for a circle

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the fitted parameters: the position, the angle if the shape has one, and the dimensions."""
        return ('x', 'y', *(('angle',) if self.symmetry else ()), *self.dimensions)

    def split(self, parameters: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        """Split ``parameters`` into the centre, (2,), the angle and the dimensions."""
        if not self.symmetry:
            return parameters[:2], 0.0, parameters[2:]
        return parameters[:2], float(parameters[2]), parameters[3:]

    def corners(self, parameters: np.ndarray) -> np.ndarray:
        """Return the corners, (corners, 2), of the outline with these ``parameters``."""
        return self.placed(*self.split(parameters))

    def placed(self, centre: np.ndarray, angle: float, dimensions: np.ndarray) -> np.ndarray:
        """Return the corners, (corners, 2), of the outline at ``centre``, (2,)."""
        return self.template @ dimensions @ rotation(angle) + centre

    def moving(self, parameters: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the corners of nested outlines, and the derivatives of the corners.

        Parameters
        ----------
        parameters : np.ndarray
            Parameters of the outer outline.
        sizes : np.ndarray
            Dimensions of the k outlines relative to those of the outer outline, (k, dimensions).

        Returns
        -------
        corners : np.ndarray
            (k, corners, 2).
        motions : np.ndarray
            Derivatives of the corners with respect to the parameters, (parameters, k, corners, 2).
        """
        centre, angle, dimensions = self.split(parameters)
        by_dimension = self.template.transpose(2, 0, 1) @ rotation(angle)
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
    """Return the outline of a shape.

    Parameters
    ----------
    shape : str
        Name of one of the five shapes.
    handedness : int
        1, or -1 for a mirrored right triangle.

    Examples
    --------
    >>> outline_of('rectangle').parameters
    ('x', 'y', 'angle', 'long', 'short')
    """
    if shape == 'right_triangle' and handedness < 0:
        return _MIRRORED
    return OUTLINES[shape]


def rotation(angle: float) -> np.ndarray:
    """Return the rotation matrix for row vectors, (2, 2), with the rotated axes as its rows."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array(((cos, sin), (-sin, cos)))


def _template(*corners: tuple[tuple[float, ...], tuple[float, ...]]) -> np.ndarray:
    """Return the template for corners given as ((x by dimension), (y by dimension))."""
    template = np.array(corners, float)
    template.flags.writeable = False
    return template


def _circle() -> np.ndarray:
    angle = np.arange(CIRCLE_CORNERS) * (2 * np.pi / CIRCLE_CORNERS)
    same_area = np.sqrt(2 * np.pi / CIRCLE_CORNERS / np.sin(2 * np.pi / CIRCLE_CORNERS))
    return _template(*(((same_area * np.cos(a),), (same_area * np.sin(a),)) for a in angle))


#: Outline of each shape, by name.
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


class Edges(NamedTuple):
    """The edges of a convex polygon with corners ordered by rotation from x to y.

    Edge i runs from corner i to the next corner.
    """

    along: np.ndarray    #: unit vectors, (n, 2)
    outward: np.ndarray  #: unit normals, (n, 2)
    length: np.ndarray   #: (n, 1)
    offset: np.ndarray   #: distance of the edge's line from the origin, along the normal, (n, 1)


def edges_of(corners: np.ndarray) -> Edges:
    """Return the edges between ``corners``, (n, 2)."""
    edge = corners[_following(corners)] - corners
    length = np.sqrt((edge**2).sum(1, keepdims=True))
    along = edge / length
    outward = along[:, ::-1] * (1.0, -1.0)
    return Edges(along, outward, length, (outward * corners).sum(1, keepdims=True))


def depth_inside(corners: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the signed distance of points from the edges of a polygon, positive inside.

    Parameters
    ----------
    corners : np.ndarray
        Corners of the polygon, (n, 2).
    x, y : np.ndarray
        Coordinates of the points, as arrays of any shape.

    Examples
    --------
    >>> square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    >>> depth_inside(square, np.array([1.0, 5.0]), np.array([2.0, 2.0])).tolist()
    [1.0, -1.0]
    """
    edges = edges_of(corners)
    depths = [offset - (outward[0] * x + outward[1] * y) for outward, (offset,) in zip(edges.outward, edges.offset)]
    return np.minimum.reduce(depths)


def moving_depth(corners: np.ndarray, motions: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the signed distance of points from the edges of a moving polygon, and its derivatives.

    Parameters
    ----------
    corners : np.ndarray
        Corners of the polygon, (n, 2).
    motions : np.ndarray
        Derivatives of the corners with respect to the parameters, (p, n, 2).
    places : np.ndarray
        Points, (2, m).

    Returns
    -------
    depth : np.ndarray
        (m,), positive inside.
    derivatives : np.ndarray
        (p, m).
    """
    edges = edges_of(corners)
    depth = edges.offset - edges.outward @ places
    nearest = depth.argmin(0)
    each = np.arange(len(nearest))
    start = (edges.along * corners).sum(1, keepdims=True)
    t = ((edges.along @ places - start) / edges.length)[nearest, each]
    at_start = (motions * edges.outward).sum(-1)[:, nearest]
    at_stop = (motions[:, _following(corners)] * edges.outward).sum(-1)[:, nearest]
    return depth[nearest, each], at_start + (at_stop - at_start) * t


def _following(corners: np.ndarray) -> np.ndarray:
    return np.arange(1, len(corners) + 1) % len(corners)


FAR_LEFT = -1e6    #: An x coordinate to the left of all taxels.
TINY_TILT = 1e-12  #: Tilt of an edge that runs along rows or columns, which avoids a division by zero.


class Window(NamedTuple):
    """A rectangular block of taxels.

    Taxel (row, col) is the unit square with its centre at x = col, y = row.
    """

    row: int
    col: int
    rows: int
    cols: int


def coverages(corners: np.ndarray, motions: np.ndarray, window: Window, weights: np.ndarray,
              of_change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return weighted sums of the areas that polygons cover in each taxel, and the derivatives of one more sum.

    Parameters
    ----------
    corners : np.ndarray
        Corners of the k polygons, (k, n, 2).
    motions : np.ndarray
        Derivatives of the corners with respect to the parameters, (p, k, n, 2).
    window : Window
        The taxels.
    weights : np.ndarray
        Weight of each polygon in each sum, (m, k).
    of_change : np.ndarray
        Weight of each polygon in the sum whose derivatives are returned, (k,).

    Returns
    -------
    covered : np.ndarray
        The sums, (m, rows, cols).
    change : np.ndarray
        The derivatives, (p, rows, cols).

    Notes
    -----
    The function uses the divergence theorem. Let N be the outward normal of an edge, with the length of the edge, and
    let t0...t1 be the part of the edge within a taxel. The derivative of the area is ∫ N · motion dt. The area itself
    is ∫ N_x (x - left) dt plus the length of the taxel's right side within the polygon. The length of the right side
    within the polygon is a sum over all edges to the left of this side.
    """
    sums, each = len(weights), corners.shape[1]
    edges = corners.shape[0] * each
    following = np.arange(1, each + 1) % each
    start, stop = corners.reshape(-1, 2), corners[:, following].reshape(-1, 2)
    edge = stop - start
    normal = edge[:, ::-1] * (1.0, -1.0)
    rows = np.empty((2 * sums + len(motions), 2 * edges))
    weight = np.repeat(weights, each, axis=1) * normal[:, 0]
    rows[sums:2 * sums, :edges] = rows[sums:2 * sums, edges:] = weight
    rows[:sums, :edges], rows[:sums, edges:] = weight * start[:, 0], weight * stop[:, 0]
    by_corner = motions * (normal.reshape(corners.shape) * of_change[:, np.newaxis, np.newaxis])
    rows[2 * sums:, :edges] = (by_corner[..., 0] + by_corner[..., 1]).reshape(-1, edges)
    by_corner = motions[:, :, following] * (normal.reshape(corners.shape) * of_change[:, np.newaxis, np.newaxis])
    rows[2 * sums:, edges:] = (by_corner[..., 0] + by_corner[..., 1]).reshape(-1, edges)
    stretches = _stretches(start, edge, window).reshape(2 * edges, -1)
    flux = (rows @ stretches).reshape(len(rows), window.rows, window.cols + 1)
    left = window.col - 0.5 + np.arange(window.cols)
    right_side = -flux[sums:2 * sums].cumsum(2)[..., 1:]
    return flux[:sums, :, 1:] - left * flux[sums:2 * sums, :, 1:] + right_side, flux[2 * sums:, :, 1:]


def _stretches(start: np.ndarray, edge: np.ndarray, window: Window) -> np.ndarray:
    """Return ∫ (1 - t) dt and ∫ t dt for each edge within each taxel, (2, edges, rows, 1 + cols).

    The first column covers the whole area to the left of the window, because the pad's edge may cut off a contact.
    """
    edge = np.where(np.abs(edge) < TINY_TILT, TINY_TILT, edge)
    lines = np.empty((len(start), window.cols + window.rows + 3))
    x_lines, y_lines = lines[:, :window.cols + 2], lines[:, window.cols + 2:]
    x_lines[:] = np.arange(window.col - 1.5, window.col + window.cols)
    x_lines[:, 0] = FAR_LEFT
    y_lines[:] = np.arange(window.row - 0.5, window.row + window.rows)
    x_lines -= start[:, :1]
    x_lines /= edge[:, :1]
    y_lines -= start[:, 1:]
    y_lines /= edge[:, 1:]
    np.minimum(np.maximum(lines, 0, out=lines), 1, out=lines)
    enters = np.minimum(lines[:, :-1], lines[:, 1:])  # one value for each strip between two lines
    leaves = np.maximum(lines[:, :-1], lines[:, 1:])
    cols, rows = slice(window.cols + 1), slice(window.cols + 2, None)
    begin = np.maximum(enters[:, None, cols], enters[:, rows, None])
    length = np.minimum(leaves[:, None, cols], leaves[:, rows, None])
    length -= begin
    np.maximum(length, 0, out=length)
    stretches = np.empty((2, *length.shape))
    np.multiply(length, begin + 0.5 * length, out=stretches[1])
    np.subtract(length, stretches[1], out=stretches[0])
    return stretches
