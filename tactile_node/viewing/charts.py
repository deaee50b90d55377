"""Pictures of a report as inline SVG: pads, and charts over time with at most MOST_POINTS points."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tactile_node.colour_map import PALETTE, STEPS, rounded_up

HEAT_LEVELS = 48
NO_VALUE_COLOUR = '#9a9a9a'
OUTLINE_COLOUR = '#00e5ff'
PAD_HEIGHT = 200  #: of a picture of a pad [pixels]


def colour(share: float) -> str:
    """0 ... 1 -> its colour.

    >>> colour(0.0), colour(1.0)
    ('#000004', '#fcffa4')
    """
    return '#' + bytes(PALETTE[round(min(max(share, 0.0), 1.0) * (STEPS - 1))]).hex()


def cells(colours: Sequence[tuple[str, np.ndarray]]) -> str:
    """One path for each colour and its places, bool (rows, cols); row 0 is at the bottom, a taxel is 1 x 1."""
    paths = []
    for fill, places in colours:
        if places.any():
            rows = places.shape[0]
            data = ''.join(f'M{first} {rows - 1 - row}h{length}v1h-{length}z' for row, first, length in _runs(places))
            paths.append(f'<path fill="{fill}" d="{data}"/>')
    return ''.join(paths)


def heat_cells(values: np.ndarray, top: float) -> str:
    """``values`` (rows, cols), NaN: no value; ``top`` has the brightest colour."""
    with np.errstate(invalid='ignore'):
        levels = np.clip(np.rint(values / top * (HEAT_LEVELS - 1)) if top > 0 else 0 * values, 0, HEAT_LEVELS - 1)
    shades = [(colour(level / (HEAT_LEVELS - 1)), levels == level) for level in range(HEAT_LEVELS)]
    return cells([*shades, (NO_VALUE_COLOUR, np.isnan(values))])


def grid(rows: int, cols: int, content: str, label: str) -> str:
    """A picture of a pad: ``content`` in units of taxels."""
    width = max(40, round(PAD_HEIGHT * cols / rows))
    return (f'<svg class="pad" role="img" aria-label="{label}" width="{width}" height="{PAD_HEIGHT}" '
            f'viewBox="0 0 {cols} {rows}" shape-rendering="crispEdges">{content}</svg>')


def outline(corners: np.ndarray, pitch: float, rows: int) -> str:
    """``corners`` (n, 2) in the pad's frame [m]: x along columns, y along rows, taxel (0, 0) at the origin."""
    points = ' '.join(f'{x / pitch + 0.5:.3f},{rows - 0.5 - y / pitch:.3f}' for x, y in corners)
    return (f'<polygon points="{points}" fill="none" stroke="{OUTLINE_COLOUR}" stroke-width="{rows / 90:.3f}" '
            'shape-rendering="geometricPrecision"/>')


def colour_bar(top: str) -> str:
    """From 0 to the text ``top``, which carries its unit."""
    steps = ''.join(f'<rect x="{4 * k}" width="4.2" height="10" fill="{colour(k / 23)}"/>' for k in range(24))
    return (f'<svg class="bar" width="200" height="12" role="img" aria-label="colours from 0 to {top}">'
            f'<text x="0" y="10">0</text><g transform="translate(12,1)">{steps}</g>'
            f'<text x="114" y="10">{top}</text></svg>')


def _runs(places: np.ndarray) -> list[tuple[int, int, int]]:
    """Row, first column and length of each run of places in a row."""
    edges = np.diff(np.pad(places.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    begins, ends = np.argwhere(edges == 1), np.argwhere(edges == -1)
    return [(int(row), int(first), int(last - first)) for (row, first), (_, last) in zip(begins, ends)]


CHART_WIDTH, CHART_HEIGHT, CHART_LEFT, CHART_BOTTOM = 940, 130, 64, 22
MOST_POINTS = 900  #: points of one line: more than one a pixel is not seen


class Points(NamedTuple):
    """Points of one colour; ``x`` in seconds."""

    colour: str
    x: np.ndarray
    y: np.ndarray


def chart(lines: Sequence[Points], dots: Sequence[Points], *, end: float, top: float, unit: str) -> str:
    """From 0 to ``end`` s and from 0 to ``top``, which carries ``unit``."""
    top = top if top > 0 and math.isfinite(top) else 1.0
    end = end if end > 0 else 1.0

    def place(x: float, y: float) -> tuple[float, float]:
        return (CHART_LEFT + x / end * (CHART_WIDTH - CHART_LEFT - 8),
                CHART_HEIGHT - CHART_BOTTOM - min(y / top, 1.0) * (CHART_HEIGHT - CHART_BOTTOM - 8))

    drawn = [_axes(place, end, top, unit)]
    for colour, x, y in lines:
        points = ' '.join('{:.1f},{:.1f}'.format(*place(float(a), float(b))) for a, b in zip(x, y))
        drawn.append(f'<polyline fill="none" stroke="{colour}" stroke-width="1.2" points="{points}"/>')
    for colour, x, y in dots:
        data = ''.join('M{:.1f} {:.1f}h0'.format(*place(float(a), float(b))) for a, b in zip(x, y))
        drawn.append(f'<path stroke="{colour}" stroke-width="4" stroke-linecap="round" d="{data}"/>')
    return f'<svg class="chart" viewBox="0 0 {CHART_WIDTH} {CHART_HEIGHT}" role="img">{"".join(drawn)}</svg>'


def thin(values: np.ndarray, keep_highest: bool) -> np.ndarray:
    """Return the indices of at most MOST_POINTS of ``values``: of each part the highest, or the lowest.

    >>> thin(np.array([3.0, 1.0]), True).tolist()
    [0, 1]
    """
    if len(values) <= MOST_POINTS:
        return np.arange(len(values))
    parts = np.array_split(np.arange(len(values)), MOST_POINTS)
    pick = np.nanargmax if keep_highest else np.nanargmin
    return np.array([part[pick(values[part])] if np.isfinite(values[part]).any() else part[0] for part in parts])


def _axes(place, end: float, top: float, unit: str) -> str:
    parts = []
    for k in range(int(end / rounded_up(end / 10)) + 1):
        value = k * rounded_up(end / 10)
        x, y = place(value, 0)
        parts.append(f'<path class="tick" d="M{x:.1f} {y}V8"/><text x="{x:.1f}" y="{y + 14}" '
                     f'text-anchor="middle">{value:g}{" s" if k == 0 else ""}</text>')
    for k in range(int(top / rounded_up(top / 3) + 1e-9) + 1):
        value = k * rounded_up(top / 3)
        x, y = place(0, value)
        parts.append(f'<path class="tick" d="M{x} {y:.1f}H{CHART_WIDTH - 8}"/><text x="{x - 5}" y="{y + 4:.1f}" '
                     f'text-anchor="end">{value:g}{" " + unit if unit else ""}</text>')
    return ''.join(parts)
