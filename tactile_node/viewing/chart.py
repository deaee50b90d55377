"""Draw values over time as an inline SVG chart."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from tactile_node.colour_map import rounded_up
from tactile_node.viewing.templates import shared

POINT_COLOURS = '#0ea5e9', '#f97316', '#16a34a', '#a855f7'  #: colours assigned to the pads in order
LEAST_TOP = 1.0  #: minimum upper end of the value axis [unit of the values]
MOST_POINTS = 900  #: maximum number of points of a series, about one per pixel
LINE_WIDTH = 1.5  #: [pixels]
DOT_WIDTH = 4  #: [pixels]
PARTS = 4  #: number of intervals into which ticks divide an axis, approximately


class PlotArea(NamedTuple):
    """Size of a picture and its margins."""

    width: float
    height: float
    left: float
    right: float
    top: float
    bottom: float

    def place(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Convert fractions ``x`` and ``y`` of the axis ranges to places. ``x`` and ``y`` may be arrays."""
        return (self.left + x * (self.width - self.left - self.right),
                self.height - self.bottom - y * (self.height - self.top - self.bottom))


PLOT_AREA = PlotArea(760, 140, 56, 10, 10, 22)


class Series(NamedTuple):
    """Values drawn in one colour. Values that are not finite are left out."""

    colour: str
    x: np.ndarray     #: times [s], ascending
    y: np.ndarray
    gap: float = 0.0  #: time below which two successive points are joined by a line [s]; 0 draws dots


def chart(series: Sequence[Series], begin: float, end: float, unit: str) -> Markup:
    """Return a chart with time from ``begin`` to ``end`` [s], and values from 0 in ``unit``."""
    end = end if end > begin else begin + 1.0
    top = rounded_up(max([LEAST_TOP, *(float(np.max(each.y, initial=0.0, where=np.isfinite(each.y)))
                                       for each in series)]))
    x_ticks = [(PLOT_AREA.place((time - begin) / (end - begin), 0)[0], f'{time:g} s') for time in ticks(begin, end)]
    y_ticks = [(PLOT_AREA.place(0, share)[1], f'{share * top:g} {unit}') for share in (0.0, 0.5, 1.0)]
    return shared().chart(PLOT_AREA, x_ticks, y_ticks, [
        (each.colour, LINE_WIDTH if each.gap else DOT_WIDTH, _path(each, begin, end, top)) for each in series])


def _path(series: Series, begin: float, end: float, top: float) -> Markup:
    is_inside = np.isfinite(series.y) & (series.x >= begin) & (series.x <= end)
    times, values = series.x[is_inside], series.y[is_inside]
    kept = thin(values)
    times, values = times[kept], values[kept]
    is_joined = np.diff(times, prepend=-np.inf) < series.gap
    x, y = PLOT_AREA.place((times - begin) / (end - begin), values / top)
    return Markup(''.join(f'L{x:.1f} {y:.1f}' if joined else f'M{x:.1f} {y:.1f}h0'  # nosec B704: numbers
                          for x, y, joined in zip(x, y, is_joined)))


def ticks(begin: float, end: float) -> list[float]:
    """Return the multiples of a round step from ``begin`` to ``end``, about PARTS of them.

    >>> ticks(-20, 0), ticks(0, 30)
    ([-20.0, -15.0, -10.0, -5.0, 0.0], [0.0, 10.0, 20.0, 30.0])
    """
    step = rounded_up((end - begin) / PARTS) if end > begin else 1.0
    return [step * k for k in range(int(np.ceil(begin / step - 1e-9)), int(np.floor(end / step + 1e-9)) + 1)]


def thin(values: np.ndarray) -> np.ndarray:
    """Return the indices of at most MOST_POINTS values: the lowest and the highest value of each section.

    >>> thin(np.array([3.0, 1.0])).tolist()
    [0, 1]
    """
    if len(values) <= MOST_POINTS:
        return np.arange(len(values))
    parts = np.array_split(np.arange(len(values)), MOST_POINTS // 2)
    return np.unique([part[pick(values[part])] for part in parts for pick in (np.argmin, np.argmax)])
