"""Compute numbers that describe a patch independently of the contact's rotation.

The numbers are moments of the contact and of its hull, the width of the hull, and the overlap of each of the five
shapes with the contact (`_likeness`). The hull fills in silent taxels inside the contact.

The moments follow Flusser (On the independence of rotation moment invariants, Pattern Recognition 33, 2000). The
support function h(a) of the hull is the maximum of x cos a + y sin a over the contact. The area of the hull is the
integral of (h^2 - h'^2) / 2, and the width of the hull at a is h(a) + h(a + 180 degrees).
"""

from math import comb

import numpy as np

from tactile_node.shape.patch import SIDE

FIGURES = 'rectangle', 'square', 'triangle', 'disc'  #: Figures in the order of their overlaps.
LIKENESS_COUNT = len(FIGURES) + 1  #: Number of values: the overlap with each figure, and the whitened third moment.
DIRECTIONS = 48
DIRECTION_ANGLES = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
DIRECTION_VECTORS = np.array([np.sin(DIRECTION_ANGLES), np.cos(DIRECTION_ANGLES)])
CELL_PLACES = np.arange(SIDE, dtype=float)
HARMONICS = 8
HARMONIC_WAVES = np.exp(-1j * np.outer(DIRECTION_ANGLES, np.arange(HARMONICS + 1))) / DIRECTIONS
#: Orders (p, q) of the complex moments c_pq.
MOMENT_ORDERS = ((2, 0), (1, 1), (3, 0), (2, 1), (4, 0), (3, 1), (2, 2), (5, 0), (6, 0))
HIGHEST_ORDER = 6
COUNT = 9 + 2 * len(MOMENT_ORDERS) + HARMONICS + LIKENESS_COUNT  #: Number of values that describe a patch.
LOG_TAXELS = 0  #: Index of the log of the contact's number of taxels.
OVERLAPS = slice(COUNT - LIKENESS_COUNT, COUNT - 1)  #: Indices of the overlaps with FIGURES.

FLATTEST_RATIO = 0.02  #: Smallest second moment across the contact, as a share of the mean of both second moments.
SIDE_ANGLES = np.arange(4) * np.pi / 2  #: Directions from the centre to a rectangle's sides [rad].
#: Directions from the centre to an equilateral triangle's sides if its third moment is real [rad]. One side is listed
#: twice.
CORNER_ANGLES = np.array((1, -1 / 3, 1 / 3, 1)) * np.pi
#: Distance of an equilateral triangle's sides from its centre if its second moments are 1.
TRIANGLE_DISTANCE = 2 ** 0.5
DISC_RADIUS = np.pi ** -0.5
HALF_CELL = np.float32(0.5)


def _expansion(p: int, q: int) -> np.ndarray:
    """Return the coefficients of y^a x^b in (x + iy)^p (x - iy)^q, shape ((HIGHEST_ORDER + 1)^2,)."""
    found = np.zeros((HIGHEST_ORDER + 1, HIGHEST_ORDER + 1), complex)
    for j in range(p + 1):
        for k in range(q + 1):
            found[j + k, p - j + q - k] += comb(p, j) * comb(q, k) * 1j ** j * (-1j) ** k
    return found.reshape(-1)


MOMENT_EXPANSIONS = np.array([_expansion(p, q) for p, q in MOMENT_ORDERS]).T
DIRECTION_BEFORE = np.arange(-1, DIRECTIONS - 1)


def describe_all(levels: np.ndarray, unseen: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Return the feature vectors of K patches.

    Parameters
    ----------
    levels : np.ndarray
        Levels of the patches, (K, SIDE, SIDE).
    unseen : np.ndarray
        Unseen share of each cell, (K, SIDE, SIDE).
    scales : np.ndarray
        Width of a cell [taxels], (K,).

    Returns
    -------
    np.ndarray
        float32 (K, COUNT).
    """
    weight = np.minimum(np.maximum(levels, 0), 1.5).astype(float)
    down, across = weight.sum(2), weight.sum(1)
    total = down.sum(1)
    y, x = (CELL_PLACES - (profile @ CELL_PLACES / total)[:, None] for profile in (down, across))
    sizes = np.array([np.log(total * scales ** 2), 10 / (total * scales ** 2), np.log(scales), unseen.mean((1, 2))])
    support = _support(levels > 0.5, y, x)
    moments = _moments(weight, y, x, total)
    return np.concatenate((sizes.T, _magnitudes(moments), _widths(support, total),
                           _hull_moments(support, y, x, total),
                           _likeness(weight, y, x, total, moments)), 1).astype(np.float32)


def _moments(weight: np.ndarray, y: np.ndarray, x: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Return the means of y^a x^b, (K, HIGHEST_ORDER + 1, HIGHEST_ORDER + 1).

    The unit of length is the square root of the area.
    """
    unit = 1 / np.sqrt(total)[:, None]
    sums = _powers(y * unit) @ weight @ _powers(x * unit).transpose(0, 2, 1)
    return sums / total[:, None, None]


def _powers(places: np.ndarray) -> np.ndarray:
    """Return the powers of ``places``, (K, n), as products, (K, HIGHEST_ORDER + 1, n)."""
    factors = np.repeat(places[:, np.newaxis], HIGHEST_ORDER + 1, 1)
    factors[:, 0] = 1
    return factors.cumprod(1)


def _magnitudes(moments: np.ndarray) -> np.ndarray:
    """Return the magnitudes of the complex moments."""
    return np.abs(moments.reshape(len(moments), -1) @ MOMENT_EXPANSIONS)


def _support(inside: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the support function, (K, DIRECTIONS), of all cells more than half covered.

    The support function reaches half a cell beyond the centres of the cells.
    """
    cells = inside.reshape(len(inside), -1).sum(1)
    if not cells.all():  # a patch without covered cells gets a single cell at its centre
        inside = inside.copy()
        inside[cells == 0, SIDE // 2, SIDE // 2] = True
        cells = np.maximum(cells, 1)
    k, row, col = inside.nonzero()
    reach = np.array((y[k, row], x[k, col])).T @ DIRECTION_VECTORS
    return np.maximum.reduceat(reach, cells.cumsum() - cells, 0) + 0.5


def _widths(support: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Return measures of the hull of a patch.

    They are the shares of the hull and of the smallest box that the patch fills, the ratio of the smallest to the
    largest width, and the harmonics of the support function.
    """
    half, quarter = DIRECTIONS // 2, DIRECTIONS // 4
    width = support[:, :half] + support[:, half:]
    box = width[:, :quarter] * width[:, quarter:]
    harmonics = np.abs(support @ HARMONIC_WAVES)
    slope = (support - support[:, DIRECTION_BEFORE]) * (DIRECTIONS / (2 * np.pi))
    area = np.pi * (support * support - slope * slope).sum(1) / DIRECTIONS
    fills = np.array((total / np.maximum(area, 1), total / box.min(1), width.min(1) / width.max(1),
                      harmonics[:, 0] / np.sqrt(total)))
    return np.concatenate((fills.T, harmonics[:, 1:] / harmonics[:, :1]), 1)


def _hull_moments(support: np.ndarray, y: np.ndarray, x: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Return the covered share of the hull and the moments of the filled hull, whose rim is softened over one cell."""
    reach = support.max() + 0.5
    y, x = (places[:, np.abs(places).min(0) < reach] for places in (y, x))  # all other cells lie outside every hull
    towards = support[:, :, None, None] + 0.5 - DIRECTION_VECTORS[0, :, None, None] * y[:, None, :, None]
    depth = (towards - DIRECTION_VECTORS[1, :, None, None] * x[:, None, None, :]).min(1)
    filled = np.minimum(np.maximum(depth, 0), 1)
    down, across = filled.sum(2), filled.sum(1)
    area = down.sum(1)
    y, x = (place - ((profile * place).sum(1) / area)[:, None] for profile, place in ((down, y), (across, x)))
    return np.concatenate(((total / area)[:, None], _magnitudes(_moments(filled, y, x, area))), 1)


def _likeness(weight: np.ndarray, y: np.ndarray, x: np.ndarray, total: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Return how well the figures cover K patches.

    None of the five shapes covers an object of another shape well. The moments of the patch determine how each figure
    is placed on the patch:

    - A triangle is the affine image of an equilateral triangle. The phase of the third moment gives the orientation of
      the triangle, in coordinates in which the second moments are those of a disc.
    - A rectangle lies along the principal axes.
    - A square is oriented by the phase of the fourth moment.

    The overlap is the intersection of the two areas over their union, with edges softened over one cell.

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
        Overlap with each of FIGURES, then the magnitude of the whitened third moment, (K, LIKENESS_COUNT).
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
