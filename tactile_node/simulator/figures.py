"""Figures that are none of the five shapes, by name or by their silhouette, as what touches a pad.

They stand for users' own shapes: what `tactile teach` learns and `tactile simulate` presses. Lengths and places are in
taxel pitches, as in world.py.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

import numpy as np
from scipy import ndimage

from tactile_node.errors import InputError
from tactile_node.simulator.world import PAD
from tactile_node.taxel_frame import read_only

DRAWN_CELLS = 192  #: along the square, x and y from -1 to 1, that a named figure is drawn in
LEAST_CELLS = 30  #: that a silhouette has: fewer have no outline worth pressing
MOST_SIDE = 2048  #: rows or columns of a silhouette

Drawing = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Silhouette:
    """A figure without a size, read-only."""

    name: str
    distance: np.ndarray          #: signed distance from the outline, positive inside [cells], (rows, cols)
    cells: int                    #: filled
    middle: tuple[float, float]   #: centre of area, x and y [cells]

    @property
    def reach(self) -> float:
        """Distance of the farthest filled cell from the centre of area [cells]."""
        rows, cols = (self.distance > 0).nonzero()
        return float(np.hypot(cols - self.middle[0], rows - self.middle[1]).max() + 1)


@dataclass(frozen=True)
class Figure:
    """A silhouette on a pad: its centre of area, its rotation (x towards y) and its area [taxels]."""

    silhouette: Silhouette
    area: float
    x: float
    y: float
    angle: float = 0.0

    @property
    def shape(self) -> str:
        return self.silhouette.name

    @property
    def cell(self) -> float:
        """Side of the silhouette's cells [pitches]."""
        return float(np.sqrt(self.area / self.silhouette.cells))

    @property
    def reach(self) -> float:
        """Distance of its farthest point from the centre [pitches]."""
        return self.silhouette.reach * self.cell

    def depth(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Signed distance of points from the outline, positive inside; exact to a cell of the silhouette."""
        u, v = (x - self.x) / self.cell, (y - self.y) / self.cell
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        col, row = self.silhouette.middle
        places = np.stack((row + v * cos - u * sin, col + u * cos + v * sin))
        found: np.ndarray = ndimage.map_coordinates(self.silhouette.distance, places, order=1, mode='nearest')
        return found * self.cell

    def pattern(self, rows: int, cols: int) -> np.ndarray:
        """On/off pattern, bool, shape (rows, cols): a taxel is active when its centre is inside."""
        y, x = np.indices((rows, cols), float)
        return self.depth(x, y) >= 0


def silhouette_of(name: str, filled: np.ndarray) -> Silhouette:
    """Return the silhouette of the ``filled`` cells, (rows, cols). Raises InputError for what has no outline.

    >>> round(silhouette_of('square', np.ones((8, 8), bool)).reach)
    6
    """
    filled = np.asarray(filled)
    if filled.ndim != 2 or max(filled.shape) > MOST_SIDE or np.count_nonzero(filled) < LEAST_CELLS:
        raise InputError(f'silhouette of {name!r}', expected=f'up to {MOST_SIDE} cells a side, {LEAST_CELLS} or more '
                         'of them of the figure',
                         got=f'shape {filled.shape}, {np.count_nonzero(filled)} cells of the figure',
                         remedy='Draw it larger, dark on white.')
    filled = np.pad(filled.astype(bool), 2)
    filled = np.pad(filled, max(filled.shape) // 2)  # so that the distance is known where a taxel near it may lie
    distance = ndimage.distance_transform_edt(filled) - ndimage.distance_transform_edt(~filled)
    distance -= np.sign(distance) / 2  # from the cells' border, not from the next cell's middle
    rows, cols = filled.nonzero()
    return Silhouette(name, read_only(distance), len(rows), (float(cols.mean()), float(rows.mean())))


def named_silhouette(name: str) -> Silhouette:
    """Return the silhouette of one of NAMED. Raises InputError for another name."""
    if name not in NAMED:
        raise InputError('figure', expected=f'one of {", ".join(NAMED)}', got=repr(name),
                         remedy='Give a picture of it to press another one.')
    y, x = (np.mgrid[:DRAWN_CELLS, :DRAWN_CELLS] + 0.5) * (2 / DRAWN_CELLS) - 1
    return silhouette_of(name, NAMED[name](x, y))


def random_figure(rng: np.random.Generator, silhouette: Silhouette, area: float, rows: int, cols: int) -> Figure:
    """Draw a figure of ``area`` [taxels] in general position, in the middle of a pad."""
    x, y = rng.uniform(-0.5, 0.5, 2) + ((cols - 1) / 2, (rows - 1) / 2)
    return Figure(silhouette, area, x=float(x), y=float(y), angle=float(rng.uniform(0, 2 * np.pi)))


def _star(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Five points; its inner corners at 0.45 of the radius."""
    angle = np.arctan2(y, x) % (2 * np.pi / 5) - np.pi / 5
    towards, inner = np.hypot(x, y), 0.45
    # The edge from a point (1, at pi/5 from the middle of the sector) to the inner corner in its middle.
    u, v = towards * np.cos(angle), np.abs(towards * np.sin(angle))
    point = np.cos(np.pi / 5), np.sin(np.pi / 5)
    return np.greater_equal(0.95 * inner * point[1] - u * point[1] + v * (point[0] - inner), 0)


def _hexagon(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    angle = np.arctan2(y, x) % (np.pi / 3) - np.pi / 6
    return np.less_equal(np.hypot(x, y) * np.cos(angle), 0.8)


NAMED: Mapping[str, Drawing] = MappingProxyType({
    'cross': lambda x, y: (np.minimum(abs(x), abs(y)) <= 0.3) & (np.maximum(abs(x), abs(y)) <= 0.9),
    'hexagon': _hexagon,
    'l': lambda x, y: ((x <= -0.3) | (y <= -0.3)) & (np.maximum(abs(x), abs(y)) <= 0.9),
    't': lambda x, y: ((abs(x) <= 0.3) | (y >= 0.3)) & (np.maximum(abs(x), abs(y)) <= 0.9),
    'ring': lambda x, y: (np.hypot(x, y) <= 0.9) & (np.hypot(x, y) >= 0.55),
    'star': _star,
    'half_disc': lambda x, y: (np.hypot(x, y) <= 0.95) & (y >= 0),
    'slot': lambda x, y: np.hypot(np.maximum(abs(x) - 0.5, 0), y) <= 0.4,
    'd_sub': lambda x, y: (abs(y) <= 0.4) & (abs(x) <= 0.8 + 0.35 * y),
})


SUBSAMPLES = 8  #: a taxel's coverage is counted on 8×8 points


class Touching(Protocol):
    """What can touch a pad."""

    @property
    def x(self) -> float: ...

    @property
    def y(self) -> float: ...

    @property
    def reach(self) -> float: ...

    def depth(self, x: np.ndarray, y: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True)
class Skin:
    """How a skin answers to pressure."""

    full_scale: float = 100_000.0  #: [Pa]
    blur: float = 0.0              #: standard deviation of the elastomer's spread [pitches]
    noise: float = 0.0             #: standard deviation [fraction of full scale]
    dead: float = 0.0              #: fraction of taxels without a valid value (NaN), drawn again for each frame


def coverage(contact: Touching, rows: int = PAD, cols: int = PAD) -> np.ndarray:
    """Return the fraction of each taxel's square that the contact covers, shape (rows, cols).

    Counted on points, not exact as `pose.outlines.coverages`: what touches need not be a polygon (hollow, rounded, any
    outlier), and the committed weights and figures come from these very numbers.
    """
    covered, near = np.zeros((rows, cols)), _window(contact, rows, cols)
    y, x = np.indices((rows, cols))[(slice(None), *near)].astype(float)
    depth = contact.depth(x, y)
    part = (depth >= 0).astype(float)
    # half of a taxel's diagonal
    rim = np.abs(depth) < 0.708  # only there a taxel can be covered in part
    step = (np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES - 0.5
    dy, dx = (offset.reshape(-1) for offset in np.meshgrid(step, step, indexing='ij'))
    part[rim] = (contact.depth(x[rim][:, None] + dx, y[rim][:, None] + dy) >= 0).mean(1)
    covered[near] = part
    return covered


def _window(contact: Touching, rows: int, cols: int) -> tuple[slice, slice]:
    """The part of the pad that the contact can touch."""
    low = np.floor(np.array([contact.y, contact.x]) - contact.reach).astype(int)
    high = np.ceil(np.array([contact.y, contact.x]) + contact.reach).astype(int) + 1
    return slice(*np.clip((low[0], high[0]), 0, rows)), slice(*np.clip((low[1], high[1]), 0, cols))


def pressure_frame(contact: Touching | None, rng: np.random.Generator, rows: int = PAD, cols: int = PAD, *,
                   pressure: float = 0.5, tilt: tuple[float, float] = (0.0, 0.0),
                   skin: Skin = Skin()) -> np.ndarray:
    """Return taxel values [Pa], float, shape (rows, cols); ``contact`` None is an untouched pad.

    ``pressure``: mean pressure [fraction of full scale]; ``tilt``: relative rise of pressure a pitch
    along x and y from the contact's centre; never below 0 or above full scale before noise.
    """
    values = np.zeros((rows, cols))
    if contact is not None:
        y, x = np.indices((rows, cols), float)
        slope = 1 + tilt[0] * (x - contact.x) + tilt[1] * (y - contact.y)
        values = coverage(contact, rows, cols) * np.clip(pressure * slope, 0, 1)
    if skin.blur:
        values = ndimage.gaussian_filter(values, skin.blur, mode='constant')
    values = skin.full_scale * (values + skin.noise * rng.standard_normal(values.shape))
    values[rng.random(values.shape) < skin.dead] = np.nan
    return values
