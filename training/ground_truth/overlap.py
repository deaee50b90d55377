"""Measure how familiar a plane figure is: its best intersection over union with any of the five shapes.

Each shape is laid over the figure at many angles and side ratios, on a coarse raster. The simplex method improves the
best of these starts simultaneously. The candidates for the best overlap are then improved on a fine raster.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tactile_node.pose.outlines import outline_of
from tactile_node.taxel_frame import read_only
from training.ground_truth.raster import as_raster, coarser
from training.ground_truth.simplex import maximised

SHAPES = ('circle', 'square', 'rectangle', 'right_triangle', 'isosceles_triangle')
FACTOR = 4        #: Number of cells of the fine raster along one cell of the coarse raster.
STARTS = 3        #: Number of starts from which each shape is improved.
COARSE_STEPS = 50, 30   #: Number of steps on the coarse raster, for all starts, and for the best start of each shape.
FINE_STEPS = 70
MARGIN = 0.03     #: Upper bound of the error of an overlap on the coarse raster.
TIE = 0.005       #: If two overlaps differ by less than this value, the shape with fewer dimensions is chosen.

#: Number of angles (over the period of a shape) and of ratios (within its limits) that are tried first.
ANGLES, RATIOS = 24, 5
WIDEST_FIRST = 1.2           #: Largest logarithm of a side ratio that is tried first.

#: Logarithms of the sizes that are tried first, relative to the square root of the figure's area.
SIZES = (-0.05, 0.12)
#: Extent of the first simplex: x, y, angle, log size, log ratio.
SPREAD = read_only(np.array((0.06, 0.06, 0.1, 0.05, 0.1)))


class Limits(NamedTuple):
    """Limits within which a figure counts as a given shape."""

    ratio: tuple[float, float]  #: ratio of a rectangle's sides, long / short
    legs: tuple[float, float]   #: ratio of a right triangle's legs, long / short
    apex: tuple[float, float]   #: angle at the apex of an isosceles triangle [degrees]


#: Limits that include every rectangle, right triangle and isosceles triangle. Thinner figures do not occur.
ANY = Limits(ratio=(1, 16), legs=(1, 16), apex=(5, 160))


class Overlap(NamedTuple):
    """Shape that is most similar to a figure, and the intersection over union of the two, 0...1."""

    shape: str
    iou: float


class _Families(NamedTuple):
    """The n outlines to be tried. An outline has area 1 if its dimensions are root * exp(±ratio / 2)."""

    shapes: tuple[str, ...]
    is_round: np.ndarray   #: bool, (n,)
    corners: np.ndarray    #: (n, 4, 2, 2), like the template of an Outline; the first corner of a triangle is repeated
    root: np.ndarray       #: (n,)
    period: np.ndarray     #: (n,), angle of a rotation that does not change the outline [rad]
    low: np.ndarray        #: (n,), smallest logarithm of the first dimension divided by the second
    high: np.ndarray       #: (n,), largest logarithm of the first dimension divided by the second


class _Cells(NamedTuple):
    """A figure of area 1, with its centre of area at the origin."""

    filled: np.ndarray  #: float32 (rows, cols), covered fraction of each cell
    x: np.ndarray       #: float32 (cols,), x of the centres of the cells
    y: np.ndarray       #: float32 (rows,), y of the centres of the cells
    width: float        #: width of a cell


def best_overlap(figure: ArrayLike, limits: Limits = ANY) -> Overlap:
    """Return the shape that overlaps best with ``figure``, and its intersection over union, with an accuracy of about
    0.005.

    The array ``figure`` contains the corners of one polygon without crossings, (n, 2), x and y. The array can also be a
    raster with any number of pieces, (rows, cols) with more than two columns: bool, or the covered fraction of each
    cell. The ``limits`` define which figures are rectangles, right triangles and isosceles triangles. Raises ValueError
    if the figure has no area.

    >>> best_overlap(np.array([[0, 0], [6, 0], [6, 3], [0, 3]])).shape
    'rectangle'
    """
    found = overlaps(figure, limits)
    largest = max(found.values())
    shape = next(shape for shape, iou in found.items() if iou >= largest - TIE)
    return Overlap(shape, largest)


def overlaps(figure: ArrayLike, limits: Limits = ANY) -> dict[str, float]:
    """Return the best overlap with each of the five shapes.

    For shapes far from the best one, the result is a lower bound.
    """
    raster, families = as_raster(figure), _families(limits)
    fine, coarse = _cells(raster), _cells(coarser(raster, FACTOR))
    kinds, poses = _first(coarse, families)
    for steps in COARSE_STEPS:
        poses, found = _improved(coarse, families, kinds, poses, SPREAD, steps)
        best = _best(kinds, found)
        kinds, poses, found = kinds[best], poses[best], found[best]
    likely = found >= found.max() - MARGIN
    found -= MARGIN
    _, found[likely] = _improved(fine, families, kinds[likely], poses[likely], SPREAD / 3, FINE_STEPS)
    by_shape = dict.fromkeys(SHAPES, 0.0)
    for kind, iou in zip(kinds, found):
        by_shape[families.shapes[kind]] = max(by_shape[families.shapes[kind]], float(iou))
    return by_shape


def _families(limits: Limits) -> _Families:
    """Return the outlines within ``limits``. The right triangle is included twice, the second time mirrored."""
    turn, root = 2 * np.pi, 2 ** 0.5
    apex = 2 * np.tan(np.radians(limits.apex) / 2)
    rows = [('circle', np.zeros((4, 2, 2)), 1.0, turn, (1, 1)),
            ('square', np.repeat(_template('square'), 2, -1) / 2, 1.0, turn / 4, (1, 1)),
            ('rectangle', _template('rectangle'), 1.0, turn / 2, limits.ratio),
            *(('right_triangle', _template('right_triangle', side), root, turn, limits.legs) for side in (1, -1)),
            ('isosceles_triangle', _template('isosceles_triangle'), root, turn, apex)]
    shapes, corners, roots, periods, ratios = zip(*rows)
    low, high = np.log(np.array(ratios, float)).T
    return _Families(shapes, np.array(shapes) == 'circle', np.array(corners), np.array(roots), np.array(periods),
                     low, high)


def _template(shape: str, handedness: int = 1) -> np.ndarray:
    template = outline_of(shape, handedness).template
    return template[np.arange(4) % len(template)]


def _cells(raster: np.ndarray) -> _Cells:
    area = raster.sum()
    width = area ** -0.5
    y, x = (np.arange(size) - raster.sum(axis) @ np.arange(size) / area for size, axis in zip(raster.shape, (1, 0)))
    return _Cells(raster.astype(np.float32), (x * width).astype(np.float32), (y * width).astype(np.float32), width)


def _first(cells: _Cells, families: _Families) -> tuple[np.ndarray, np.ndarray]:
    """Return the index of the outline of each start, (s,), and the pose of each start, (s, 5)."""
    kinds, poses = [], []
    for kind, (low, high) in enumerate(zip(families.low, families.high)):
        angles = np.arange(1 if families.is_round[kind] else ANGLES) * (families.period[kind] / ANGLES)
        ratios = np.linspace(max(low, -WIDEST_FIRST), min(high, WIDEST_FIRST), RATIOS if high > low else 1)
        tried = np.array([(0, 0, angle, size, ratio) for angle in angles for ratio in ratios for size in SIZES])
        found = _iou(cells, families, np.full(len(tried), kind), tried)
        chosen = _peaks(found.reshape(len(angles), len(ratios), len(SIZES)))
        kinds += [kind] * len(chosen)
        poses += list(tried[chosen])
    return np.array(kinds), np.array(poses)


def _peaks(found: np.ndarray) -> list[int]:
    """Return the indices of the STARTS best of (angles, ratios, sizes).

    No two of these starts are adjacent in angle and ratio.
    """
    left = found.copy()
    chosen: list[int] = []
    angles, ratios, sizes = found.shape
    for _ in range(min(STARTS, angles)):
        best = int(left.argmax())
        angle, ratio = best // (ratios * sizes), best // sizes % ratios
        chosen.append(best)
        near = (angle + np.arange(-1, 2)) % angles
        left[near[:, None], np.arange(max(ratio - 1, 0), min(ratio + 2, ratios))] = -1
    return chosen


def _best(kinds: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Return the index of the best start for each outline."""
    return np.array([np.flatnonzero(kinds == kind)[found[kinds == kind].argmax()] for kind in np.unique(kinds)])


def _improved(cells: _Cells, families: _Families, kinds: np.ndarray, poses: np.ndarray, spread: np.ndarray,
              steps: int) -> tuple[np.ndarray, np.ndarray]:
    def function(tried: np.ndarray, start: np.ndarray) -> np.ndarray:
        return _iou(cells, families, kinds[start], tried)
    return maximised(function, poses, spread, steps)


def _iou(cells: _Cells, families: _Families, kinds: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Return the intersections over union, (m,), for poses, (m, 5), with their ratios limited to the allowed range."""
    area = np.exp(2 * poses[:, 3])
    is_round = families.is_round[kinds]
    common = np.empty(len(poses))
    for chosen, function in ((is_round, _common_with_circles), (~is_round, _common_with_polygons)):
        if chosen.any():
            common[chosen] = function(cells, families, kinds[chosen], poses[chosen])
    ious: np.ndarray = common / (1 + area - common)
    return ious


def _corners(families: _Families, kinds: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Return the corners of the outlines, (m, 4, 2)."""
    half = np.clip(poses[:, 4], families.low[kinds], families.high[kinds]) / 2
    size = np.exp(poses[:, 3]) * families.root[kinds]
    lengths = np.stack((size * np.exp(half), size * np.exp(-half)), 1)
    x, y = (families.corners[kinds] @ lengths[:, None, :, None])[..., 0].transpose(2, 0, 1)
    cos, sin = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    return np.stack((x * cos - y * sin + poses[:, :1], x * sin + y * cos + poses[:, 1:2]), -1)


def _common_with_polygons(cells: _Cells, families: _Families, kinds: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Return the area that each polygon shares with the figure.

    Each cell is weighted with its depth [cells] + 1/2, limited to the range from 0 to its covered fraction. Edges are
    therefore softened over the width of one cell.
    """
    corners = _corners(families, kinds, poses)
    is_triangle = (corners[:, 3] == corners[:, 0]).all(1)
    following = np.roll(corners, -1, axis=1)
    following[is_triangle, 3] = corners[is_triangle, 1]  # repeats the first edge of a triangle
    edge = following - corners
    outward = (edge / np.sqrt((edge ** 2).sum(-1, keepdims=True)))[..., ::-1] * (1.0, -1.0) / cells.width
    offset = (outward * corners).sum(-1) + 0.5
    along_x = -outward[..., :1].astype(np.float32) * cells.x
    along_y = (offset[..., None] - outward[..., 1:] * cells.y).astype(np.float32)
    inside = np.broadcast_to(cells.filled, (len(corners), *cells.filled.shape)).copy()
    line = np.empty_like(inside)
    for side in range(4):
        np.add(along_y[:, side, :, None], along_x[:, side, None], out=line)
        np.minimum(inside, line, out=inside)
    common: np.ndarray = np.maximum(inside, 0, out=inside).sum((1, 2)) * cells.width ** 2
    return common


def _common_with_circles(cells: _Cells, families: _Families, kinds: np.ndarray, poses: np.ndarray) -> np.ndarray:
    poses = poses.astype(np.float32)
    radius = np.exp(poses[:, 3]) / np.float32(np.sqrt(np.pi))
    square = (cells.y - poses[:, 1, None])[:, :, None] ** 2 + (cells.x - poses[:, 0, None])[:, None] ** 2
    depth = (radius[:, None, None] - np.sqrt(square)) / np.float32(cells.width) + np.float32(0.5)
    common: np.ndarray = np.clip(depth, 0, cells.filled).sum((1, 2)) * cells.width ** 2
    return common
