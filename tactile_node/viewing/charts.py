"""Draw the taxels of a pad, and charts of values over time, as inline SVG. The SVG macros are in pictures.html."""

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from tactile_node.colour_map import PALETTE, STEPS, rounded_up
from tactile_node.viewing.source import FORCE_HISTORY
from tactile_node.viewing.templates import environment

HEAT_LEVELS = 48  #: number of colours in a heat map
POINT_COLOURS = '#0ea5e9', '#f97316', '#16a34a', '#a855f7'  #: colours assigned to the pads in order
BAR_COLOURS = 24  #: number of colours in a colour bar


@cache
def pictures() -> Any:
    """Return the macros of pictures.html."""
    colours = [colour(k / (BAR_COLOURS - 1)) for k in range(BAR_COLOURS)]
    return environment().get_template('pictures.html', globals={'colours': colours}).module


def colour(share: float) -> str:
    """Return the colour for a fraction from 0 to 1.

    >>> colour(0.0), colour(1.0)
    ('#000004', '#fcffa4')
    """
    return '#' + bytes(PALETTE[round(min(max(share, 0.0), 1.0) * (STEPS - 1))]).hex()


def cells(colours: Sequence[tuple[str, np.ndarray]]) -> list[tuple[str, str]]:
    """Return an SVG path for each colour.

    Row 0 is at the bottom of the picture, and each taxel is a unit square.

    Parameters
    ----------
    colours
        Colours, each paired with a mask of the taxels in that colour, bool, shape (rows, cols).
    """
    return [(fill, ''.join(f'M{first} {len(places) - 1 - row}h{length}v1h-{length}z'
                           for row, first, length in _runs(places))) for fill, places in colours if places.any()]


def heat_cells(values: np.ndarray, top: float) -> list[tuple[str, str]]:
    """Return SVG paths for ``values`` (rows, cols). ``top`` gets the brightest colour, and NaN is drawn grey."""
    with np.errstate(invalid='ignore'):
        levels = np.clip(np.rint(values / top * (HEAT_LEVELS - 1)) if top > 0 else 0 * values, 0, HEAT_LEVELS - 1)
    shades = [(colour(level / (HEAT_LEVELS - 1)), levels == level) for level in range(HEAT_LEVELS)]
    return cells([*shades, ('#9a9a9a', np.isnan(values))])


def outline_points(corners: np.ndarray, pitch: float, rows: int) -> str:
    """Return ``corners`` (n, 2) [m] as SVG points, with row 0 at the bottom and each taxel a unit square."""
    return ' '.join(f'{x / pitch + 0.5:.3f},{rows - 0.5 - y / pitch:.3f}' for x, y in corners)


def _runs(places: np.ndarray) -> list[tuple[int, int, int]]:
    """Return the row, first column and length of each horizontal run of True."""
    edges = np.diff(np.pad(places.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    begins, ends = np.argwhere(edges == 1), np.argwhere(edges == -1)
    return [(int(row), int(first), int(last - first)) for (row, first), (_, last) in zip(begins, ends)]


class Frame(NamedTuple):
    """Size of a chart and its margins."""

    width: float
    height: float
    left: float
    right: float
    top: float
    bottom: float

    def place(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Convert fractions ``x`` and ``y`` of the axis ranges to chart coordinates. ``x`` and ``y`` may be arrays."""
        return (self.left + x * (self.width - self.left - self.right),
                self.height - self.bottom - y * (self.height - self.top - self.bottom))


CHART = Frame(940, 130, 64, 8, 8, 22)
MOST_POINTS = 900  #: maximum number of points in a line, about one per pixel


class Points(NamedTuple):
    """Points drawn in one colour, with ``x`` in seconds."""

    colour: str
    x: np.ndarray
    y: np.ndarray


def chart(lines: Sequence[Points], dots: Sequence[Points], *, end: float, top: float, unit: str) -> Markup:
    """Return a chart with time from 0 to ``end`` [s] and values from 0 to ``top`` in ``unit``."""
    top = top if top > 0 and math.isfinite(top) else 1.0
    end = end if end > 0 else 1.0

    def path(points: Points, each: str) -> Markup:
        x, y = CHART.place(points.x / end, np.minimum(points.y / top, 1.0))
        return Markup(''.join(map(each.format, x, y)))  # nosec B704: numbers
    x_ticks = [(CHART.place(value / end, 0)[0], f'{value:g}{"" if value else " s"}') for value in ticks(end, 10)]
    return pictures().chart(
        'chart', CHART, x_ticks, _value_ticks(CHART, ticks(top, 3), top, unit),
        [(line.colour, path(line, 'L{:.1f} {:.1f}').replace('L', 'M', 1)) for line in lines],
        [(each.colour, path(each, 'M{:.1f} {:.1f}h0')) for each in dots])


def ticks(length: float, parts: int) -> list[float]:
    """Return round tick values that divide the range from 0 to ``length`` into about ``parts`` intervals."""
    step = rounded_up(length / parts) if length else 1.0
    return [k * step for k in range(int(length / step + 1e-9) + 1)]


def _value_ticks(frame: Frame, values: Sequence[float], top: float, unit: str) -> list[tuple[float, str]]:
    return [(frame.place(0, value / top)[1], f'{value:g} {unit}') for value in values]


def thin(values: np.ndarray, keep_highest: bool) -> np.ndarray:
    """Return the indices of at most MOST_POINTS values: the highest or the lowest value of each section.

    >>> thin(np.array([3.0, 1.0]), True).tolist()
    [0, 1]
    """
    if len(values) <= MOST_POINTS:
        return np.arange(len(values))
    parts = np.array_split(np.arange(len(values)), MOST_POINTS)
    pick = np.nanargmax if keep_highest else np.nanargmin
    return np.array([part[pick(values[part])] if np.isfinite(values[part]).any() else part[0] for part in parts])


FORCE = Frame(600, 220, 40, 10, 10, 24)
FORCE_GAP = 0.3     #: time between two points above which the line is interrupted [s]
LEAST_FORCE_SCALE = 1.0   #: minimum full scale of the force axis [N]
TIME_TICKS = -20, -15, -10, -5, 0


def force_chart(forces: Mapping[str, np.ndarray], now: float) -> str:
    """Return a chart of the force over time. The line has gaps where no force was measured.

    Parameters
    ----------
    forces
        Stamps [s] and forces [N] by pad name, shape (2, n).
    now
        Stamp at the right edge of the chart [s].
    """
    known = [values[1][np.isfinite(values[1])] for values in forces.values()]
    top = rounded_up(max([LEAST_FORCE_SCALE, *(float(each.max()) for each in known if len(each))]))

    def line(stamps: np.ndarray, values: np.ndarray) -> Markup:
        line, last = '', -np.inf
        for time, value in zip((stamps - now).tolist(), values.tolist()):
            if value == value and -FORCE_HISTORY <= time <= 0:
                place = FORCE.place(1 + time / FORCE_HISTORY, value / top)
                line += '{}{:.1f} {:.1f}'.format('L' if time - last < FORCE_GAP else 'M', *place)
                last = time
        return Markup(line)  # nosec B704: numbers
    return str(pictures().chart(  # viser sends only plain str, not Markup
        'tactile-force', FORCE, [(FORCE.place(1 + tick / FORCE_HISTORY, 0)[0], f'{tick} s') for tick in TIME_TICKS],
        _value_ticks(FORCE, (0.0, top / 2, top), top, 'N'),
        [(POINT_COLOURS[k % len(POINT_COLOURS)], line(*each)) for k, each in enumerate(forces.values())]))
