"""Charts over time as inline SVG, with at most MOST points."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tactile_node.colour_map import rounded_up

WIDTH, HEIGHT, LEFT, BOTTOM = 940, 130, 64, 22
MOST = 900  #: points of one line: more than one a pixel is not seen


class Points(NamedTuple):
    """Of one colour; ``x`` in seconds."""

    colour: str
    x: np.ndarray
    y: np.ndarray


def chart(lines: Sequence[Points], dots: Sequence[Points], *, end: float, top: float, unit: str) -> str:
    """From 0 to ``end`` s and from 0 to ``top``, which carries ``unit``."""
    top = top if top > 0 and math.isfinite(top) else 1.0
    end = end if end > 0 else 1.0

    def place(x: float, y: float) -> tuple[float, float]:
        return LEFT + x / end * (WIDTH - LEFT - 8), (HEIGHT - BOTTOM) - min(y / top, 1.0) * (HEIGHT - BOTTOM - 8)

    drawn = [_axes(place, end, top, unit)]
    for colour, x, y in lines:
        points = ' '.join('{:.1f},{:.1f}'.format(*place(float(a), float(b))) for a, b in zip(x, y))
        drawn.append(f'<polyline fill="none" stroke="{colour}" stroke-width="1.2" points="{points}"/>')
    for colour, x, y in dots:
        data = ''.join('M{:.1f} {:.1f}h0'.format(*place(float(a), float(b))) for a, b in zip(x, y))
        drawn.append(f'<path stroke="{colour}" stroke-width="4" stroke-linecap="round" d="{data}"/>')
    return f'<svg class="chart" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">{"".join(drawn)}</svg>'


def thinned(values: np.ndarray, keep_highest: bool) -> np.ndarray:
    """Return the indices of at most MOST of ``values``: of each part the highest, or the lowest.

    >>> thinned(np.array([3.0, 1.0]), True).tolist()
    [0, 1]
    """
    if len(values) <= MOST:
        return np.arange(len(values))
    parts = np.array_split(np.arange(len(values)), MOST)
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
        parts.append(f'<path class="tick" d="M{x} {y:.1f}H{WIDTH - 8}"/><text x="{x - 5}" y="{y + 4:.1f}" '
                     f'text-anchor="end">{value:g}{" " + unit if unit else ""}</text>')
    return ''.join(parts)
