"""Additional figures that can touch a simulated pad.

The figures represent a user's own shapes, which `tactile teach` learns and `tactile simulate` presses onto a pad.
Lengths and positions are in taxel pitches, as in world.py.
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

DRAWN_CELLS = 192  #: number of cells per side of the square from -1 to 1 in which a named figure is drawn
LEAST_CELLS = 30  #: minimum number of filled cells, because a smaller silhouette has no useful outline
MOST_SIDE = 2048  #: maximum number of rows or columns of a silhouette

Drawing = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Silhouette:
    """Outline of a figure, independent of its size. The array ``distance`` is read-only."""

    name: str
    distance: np.ndarray          #: signed distance from the outline, positive inside [cells], shape (rows, cols)
    cells: int                    #: number of filled cells
    middle: tuple[float, float]   #: centre of area, x and y [cells]

    @property
    def reach(self) -> float:
        """Distance from the centre of area to the farthest filled cell [cells]."""
        rows, cols = (self.distance > 0).nonzero()
        return float(np.hypot(cols - self.middle[0], rows - self.middle[1]).max() + 1)


@dataclass(frozen=True)
class Figure:
    """A silhouette with a size, position and angle on a pad."""

    silhouette: Silhouette
    area: float         #: area [taxels]
    x: float            #: centre of area [pitches]
    y: float
    angle: float = 0.0  #: rotation from x towards y [rad]

    @property
    def shape(self) -> str:
        return self.silhouette.name

    @property
    def cell(self) -> float:
        """Side of one cell of the silhouette [pitches]."""
        return float(np.sqrt(self.area / self.silhouette.cells))

    @property
    def reach(self) -> float:
        """Distance from the centre of area to the farthest point of the figure [pitches]."""
        return self.silhouette.reach * self.cell

    def depth(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the signed distance of points from the outline [pitches], positive inside, accurate to one cell."""
        u, v = (x - self.x) / self.cell, (y - self.y) / self.cell
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        col, row = self.silhouette.middle
        places = np.stack((row + v * cos - u * sin, col + u * cos + v * sin))
        found: np.ndarray = ndimage.map_coordinates(self.silhouette.distance, places, order=1, mode='nearest')
        return found * self.cell

    def pattern(self, rows: int, cols: int) -> np.ndarray:
        """Return the on/off pattern, bool, shape (rows, cols). A taxel is active if its centre is inside."""
        y, x = np.indices((rows, cols), float)
        return self.depth(x, y) >= 0


def silhouette_of(name: str, filled: np.ndarray) -> Silhouette:
    """Return the silhouette of a figure that is given as an array of filled cells.

    Parameters
    ----------
    name
        Name of the figure.
    filled
        Array that is True in each cell covered by the figure, bool, shape (rows, cols).

    Raises
    ------
    InputError
        Raised if the array is too large, or has too few filled cells for an outline.

    Examples
    --------
    >>> round(silhouette_of('square', np.ones((8, 8), bool)).reach)
    6
    """
    filled = np.asarray(filled)
    if filled.ndim != 2 or max(filled.shape) > MOST_SIDE or np.count_nonzero(filled) < LEAST_CELLS:
        raise InputError(f'silhouette of {name!r}', expected=f'at most {MOST_SIDE} cells per side, and at least '
                         f'{LEAST_CELLS} filled cells',
                         got=f'shape {filled.shape}, {np.count_nonzero(filled)} filled cells',
                         remedy='Draw the figure larger, dark on white.')
    filled = np.pad(filled.astype(bool), 2)
    filled = np.pad(filled, max(filled.shape) // 2)  # covers all taxels near the figure
    distance = ndimage.distance_transform_edt(filled) - ndimage.distance_transform_edt(~filled)
    distance -= np.sign(distance) / 2  # measured from the cell border, not from the centre of the next cell
    rows, cols = filled.nonzero()
    return Silhouette(name, read_only(distance), len(rows), (float(cols.mean()), float(rows.mean())))


def named_silhouette(name: str) -> Silhouette:
    """Return the silhouette of a figure in NAMED. Raises InputError for any other name."""
    if name not in NAMED:
        raise InputError('figure', expected=f'one of {", ".join(NAMED)}', got=repr(name),
                         remedy='Use one of these names.')
    y, x = (np.mgrid[:DRAWN_CELLS, :DRAWN_CELLS] + 0.5) * (2 / DRAWN_CELLS) - 1
    return silhouette_of(name, NAMED[name](x, y))


def random_figure(rng: np.random.Generator, silhouette: Silhouette, area: float, rows: int, cols: int) -> Figure:
    """Draw a random figure with the given area [taxels] in general position, in the middle of a pad."""
    x, y = rng.uniform(-0.5, 0.5, 2) + ((cols - 1) / 2, (rows - 1) / 2)
    return Figure(silhouette, area, x=float(x), y=float(y), angle=float(rng.uniform(0, 2 * np.pi)))


def _star(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Draw a five-pointed star whose inner corners are at 0.45 of the radius."""
    angle = np.arctan2(y, x) % (2 * np.pi / 5) - np.pi / 5
    towards, inner = np.hypot(x, y), 0.45
    # The edge runs from the tip (radius 1, pi/5 from the middle of the sector) to the inner corner in the middle of the
    # sector.
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


SUBSAMPLES = 8  #: number of sample points per taxel side for the coverage


class Touching(Protocol):
    """Interface of a contact or figure that can touch a pad, with lengths in pitches."""

    @property
    def x(self) -> float: ...

    @property
    def y(self) -> float: ...

    @property
    def reach(self) -> float: ...

    def depth(self, x: np.ndarray, y: np.ndarray) -> np.ndarray: ...


@dataclass(frozen=True)
class Skin:
    """Response of a skin to pressure."""

    full_scale: float = 100_000.0  #: [Pa]
    blur: float = 0.0              #: standard deviation of the pressure spread in the elastomer [pitches]
    noise: float = 0.0             #: standard deviation of the noise [fraction of full scale]
    dead: float = 0.0              #: fraction of taxels without a valid value (NaN), selected at random for each frame


def coverage(contact: Touching, rows: int = PAD, cols: int = PAD) -> np.ndarray:
    """Return the fraction of each taxel's area that the contact covers.

    Parameters
    ----------
    contact
        Contact that touches the pad.
    rows, cols
        Size of the pad.

    Returns
    -------
    numpy.ndarray
        Fractions from 0 to 1, shape (rows, cols).

    Notes
    -----
    The function counts sample points, because a contact may be hollow or rounded instead of a polygon. For polygons,
    `pose.outlines.coverages` is exact. The published weights and results are based on this point count.
    """
    covered, near = np.zeros((rows, cols)), _window(contact, rows, cols)
    y, x = np.indices((rows, cols))[(slice(None), *near)].astype(float)
    depth = contact.depth(x, y)
    part = (depth >= 0).astype(float)
    # A taxel can be partly covered only if its centre is within half its diagonal of the outline.
    rim = np.abs(depth) < 0.708
    step = (np.arange(SUBSAMPLES) + 0.5) / SUBSAMPLES - 0.5
    dy, dx = (offset.reshape(-1) for offset in np.meshgrid(step, step, indexing='ij'))
    part[rim] = (contact.depth(x[rim][:, None] + dx, y[rim][:, None] + dy) >= 0).mean(1)
    covered[near] = part
    return covered


def _window(contact: Touching, rows: int, cols: int) -> tuple[slice, slice]:
    """Return the range of rows and columns that the contact can touch."""
    low = np.floor(np.array([contact.y, contact.x]) - contact.reach).astype(int)
    high = np.ceil(np.array([contact.y, contact.x]) + contact.reach).astype(int) + 1
    return slice(*np.clip((low[0], high[0]), 0, rows)), slice(*np.clip((low[1], high[1]), 0, cols))


def pressure_frame(contact: Touching | None, rng: np.random.Generator, rows: int = PAD, cols: int = PAD, *,
                   pressure: float = 0.5, tilt: tuple[float, float] = (0.0, 0.0),
                   skin: Skin = Skin()) -> np.ndarray:
    """Return the taxel values that a contact causes.

    Parameters
    ----------
    contact
        Contact that touches the pad, or None for an untouched pad.
    rng
        Random generator for the noise and the dead taxels.
    rows, cols
        Size of the pad.
    pressure
        Mean pressure [fraction of full scale]. The pressure is clipped to the range from 0 to full scale before noise
        is added.
    tilt
        Relative pressure gradients along x and y, from the centre of the contact [1/pitch].
    skin
        Response of the skin.

    Returns
    -------
    numpy.ndarray
        Taxel values [Pa], float, shape (rows, cols), NaN for dead taxels.
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
