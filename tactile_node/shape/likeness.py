"""Measure how well each of the five shapes covers a patch.

None of the five shapes covers an object of another shape well.

The moments of the patch determine how each figure is placed on the patch:

- A triangle is the affine image of an equilateral triangle. The phase of the third moment gives the orientation of the
  triangle, in coordinates in which the second moments are those of a disc.
- A rectangle lies along the principal axes.
- A square is oriented by the phase of the fourth moment.

The overlap is the intersection of the two areas over their union, with edges softened over one cell.
"""

import numpy as np

FIGURES = 'rectangle', 'square', 'triangle', 'disc'  #: Figures in the order of their overlaps.
COUNT = 5  #: Number of values per patch: the overlap with each figure, and the whitened third moment.
FLATTEST_RATIO = 0.02  #: Smallest second moment across the contact, as a share of the mean of both second moments.
SIDE_ANGLES = np.arange(4) * np.pi / 2  #: Directions from the centre to a rectangle's sides [rad].

#: Directions from the centre to an equilateral triangle's sides if its third moment is real [rad]. One side is listed
#: twice.
CORNER_ANGLES = np.array((1, -1 / 3, 1 / 3, 1)) * np.pi
#: Distance of an equilateral triangle's sides from its centre if its second moments are 1.
TRIANGLE_DISTANCE = 2 ** 0.5
DISC_RADIUS = np.pi ** -0.5
HALF_CELL = np.float32(0.5)


def likeness(weight: np.ndarray, y: np.ndarray, x: np.ndarray, total: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Return how well the figures cover K patches.

    Parameters
    ----------
    weight : np.ndarray
        Levels of the patches, (K, rows, cols).
    y, x : np.ndarray
        Positions of the cells relative to the centre of area [cells], (K, rows) and (K, cols).
    total : np.ndarray
        Sum of the levels of each patch, (K,).
    moments : np.ndarray
        Means of y^a x^b, with the square root of the area as the unit of length, (K, 5 or more, 5 or more).

    Returns
    -------
    np.ndarray
        Overlap with each of FIGURES, then the magnitude of the whitened third moment, (K, COUNT).
    """
    root = np.sqrt(total)
    nx, ny, distance, third = _sides(moments, 1 / (12 * total))
    x, y = x.astype(np.float32), y.astype(np.float32)
    across = nx.astype(np.float32)[..., None] * x[:, None, None]  # (K, 3, 4, cols)
    down = (distance * root[:, None, None]).astype(np.float32)[..., None] - ny.astype(np.float32)[..., None] \
        * y[:, None, None]
    depth = np.empty((len(weight), 4, *weight.shape[1:]), np.float32)
    np.min(down[..., :, None] - across[..., None, :], axis=2, out=depth[:, :3])
    square = (x * x)[:, None, :] + (y * y)[:, :, None]
    depth[:, 3] = (DISC_RADIUS * root).astype(np.float32)[:, None, None] - np.sqrt(square)
    depth += HALF_CELL
    shapes = np.minimum(np.maximum(depth, 0, out=depth), 1, out=depth).reshape(len(weight), 4, -1)
    level = np.minimum(weight, 1).astype(np.float32).reshape(len(weight), 1, -1)
    common = np.minimum(level, shapes).sum(2)
    overlap = common / (level.sum(2) + shapes.sum(2) - common)
    return np.concatenate((overlap, np.abs(third)[:, None]), 1)


def _sides(moments: np.ndarray, cell: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the sides of the rectangle, the square and the triangle that fit the moments, and the third moment.

    ``cell`` is the second moment of one cell, (K,). The sides are given by their directions from the centre, (K, 3, 4)
    each for x and y, and by their distances from the centre [square roots of the area]. The third moment, complex (K,),
    is given in coordinates in which the second moments are 1.
    """
    xx, yy, xy = moments[:, 0, 2] + cell, moments[:, 2, 0] + cell, moments[:, 1, 1]
    size, stretch = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    along = np.arctan2(2 * xy, xx - yy) / 2
    long, short = np.sqrt(size + stretch), np.sqrt(np.maximum(size - stretch, FLATTEST_RATIO * size))
    turn = np.exp(-1j * along)
    to_x, to_y = turn.real / long + 1j * turn.imag / short, -turn.imag / long + 1j * turn.real / short
    third = (to_x ** 3 * moments[:, 0, 3] + 3 * to_x ** 2 * to_y * moments[:, 1, 2]
             + 3 * to_x * to_y ** 2 * moments[:, 2, 1] + to_y ** 3 * moments[:, 3, 0])
    fourth = np.angle(6 * moments[:, 2, 2] - moments[:, 0, 4] - moments[:, 4, 0]
                      + 4j * (moments[:, 3, 1] - moments[:, 1, 3])) / 4
    angles = np.array((along, fourth)).T[..., None] + SIDE_ANGLES
    white = np.sqrt(long * short)[:, None]
    towards = white * np.exp(-1j * (np.angle(third)[:, None] / 3 + CORNER_ANGLES))
    nx = np.concatenate((np.cos(angles), (towards * to_x[:, None]).real[:, None]), 1)
    ny = np.concatenate((np.sin(angles), (towards * to_y[:, None]).real[:, None]), 1)
    distance = np.empty(nx.shape)
    distance[:, 0, ::2] = np.sqrt(long / short)[:, None] / 2
    distance[:, 0, 1::2] = np.sqrt(short / long)[:, None] / 2
    distance[:, 1] = 0.5
    distance[:, 2] = TRIANGLE_DISTANCE * white
    return nx, ny, distance, third
