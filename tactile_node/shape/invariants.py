"""Compute numbers that describe a patch independently of the contact's rotation.

The numbers are moments of the contact and of its hull, the width of the hull, and the overlap of each of the five
shapes with the contact. The hull fills in silent taxels inside the contact.

The moments follow Flusser (On the independence of rotation moment invariants, Pattern Recognition 33, 2000). The
support function h(a) of the hull is the maximum of x cos a + y sin a over the contact. The area of the hull is the
integral of (h^2 - h'^2) / 2, and the width of the hull at a is h(a) + h(a + 180 degrees).
"""

from math import comb

import numpy as np

from tactile_node.shape import likeness
from tactile_node.shape.patch import SIDE

DIRECTIONS = 48
DIRECTION_ANGLES = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
DIRECTION_VECTORS = np.array([np.sin(DIRECTION_ANGLES), np.cos(DIRECTION_ANGLES)])
CELL_PLACES = np.arange(SIDE, dtype=float)
HARMONICS = 8
HARMONIC_WAVES = np.exp(-1j * np.outer(DIRECTION_ANGLES, np.arange(HARMONICS + 1))) / DIRECTIONS
#: Orders (p, q) of the complex moments c_pq.
MOMENT_ORDERS = ((2, 0), (1, 1), (3, 0), (2, 1), (4, 0), (3, 1), (2, 2), (5, 0), (6, 0))
HIGHEST_ORDER = 6
COUNT = 9 + 2 * len(MOMENT_ORDERS) + HARMONICS + likeness.COUNT  #: Number of values that describe a patch.
LOG_TAXELS = 0  #: Index of the log of the contact's number of taxels.
OVERLAPS = slice(COUNT - likeness.COUNT, COUNT - 1)  #: Indices of the overlaps with `likeness.FIGURES`.


def _expansion(p: int, q: int) -> np.ndarray:
    """Return the coefficients of y^a x^b in (x + iy)^p (x - iy)^q, shape ((HIGHEST_ORDER + 1)^2,)."""
    found = np.zeros((HIGHEST_ORDER + 1, HIGHEST_ORDER + 1), complex)
    for j in range(p + 1):
        for k in range(q + 1):
            found[j + k, p - j + q - k] += comb(p, j) * comb(q, k) * 1j ** j * (-1j) ** k
    return found.reshape(-1)


MOMENT_EXPANSIONS = np.array([_expansion(p, q) for p, q in MOMENT_ORDERS]).T
MOMENT_POWERS = np.arange(HIGHEST_ORDER + 1)[:, None]
DIRECTION_BEFORE = np.arange(-1, DIRECTIONS - 1)


def describe_all(levels: np.ndarray, unseen: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Return the numbers that describe K patches.

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
                           likeness.likeness(weight, y, x, total, moments)), 1).astype(np.float32)


def _moments(weight: np.ndarray, y: np.ndarray, x: np.ndarray, total: np.ndarray) -> np.ndarray:
    """Return the means of y^a x^b, (K, HIGHEST_ORDER + 1, HIGHEST_ORDER + 1).

    The unit of length is the square root of the area.
    """
    unit = 1 / np.sqrt(total)[:, None]
    sums = ((y * unit)[:, None] ** MOMENT_POWERS) @ weight @ ((x * unit)[..., None] ** MOMENT_POWERS.T)
    return sums / total[:, None, None]


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
    """Return the filled shares of the hull and of the smallest box, the ratio of the widths, and the harmonics.

    The harmonics are those of the support function.
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
    towards = support[:, :, None, None] + 0.5 - DIRECTION_VECTORS[0, :, None, None] * y[:, None, :, None]
    depth = (towards - DIRECTION_VECTORS[1, :, None, None] * x[:, None, None, :]).min(1)
    filled = np.minimum(np.maximum(depth, 0), 1)
    down, across = filled.sum(2), filled.sum(1)
    area = down.sum(1)
    y, x = (place - ((profile * place).sum(1) / area)[:, None] for profile, place in ((down, y), (across, x)))
    return np.concatenate(((total / area)[:, None], _magnitudes(_moments(filled, y, x, area))), 1)
