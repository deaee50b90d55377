"""Force over time (SVG), broken where there is none: a line across a gap would show what was not measured."""

from collections.abc import Mapping

import numpy as np

from tactile_node.colour_map import rounded_up
from tactile_node.viewing.pads_3d import POINTS
from tactile_node.viewing.source import HISTORY

WIDTH, HEIGHT = 60.0, 22.0
LEFT, RIGHT, TOP, BOTTOM = 4.0, 1.0, 1.0, 2.4
GAP = 0.3     #: between two points, from which on they are not joined [s]
LEAST = 1.0   #: of the scale [N]
TICKS = -20, -15, -10, -5, 0


def force_chart(forces: Mapping[str, np.ndarray], now: float) -> str:
    """Return the chart; ``forces``: stamps [s] and forces [N] of each pad, (2, n); ``now``: stamp at the right end."""
    known = [values[1][np.isfinite(values[1])] for values in forces.values()]
    top = rounded_up(max([LEAST, *(float(each.max()) for each in known if len(each))]))
    parts = [f'<svg class="tactile-force" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" font-size="1.2" fill="#5c6672">']
    for tick in TICKS:
        x = _x(tick)
        parts.append(f'<path d="M{x:g} {TOP}V{HEIGHT - BOTTOM}" stroke="#5c6672" stroke-width=".03"/>'
                     f'<text x="{x:g}" y="{HEIGHT - 1}" text-anchor="middle">{tick} s</text>')
    for force in (0.0, top / 2, top):
        y = _y(force, top)
        parts.append(f'<path d="M{LEFT} {y:g}H{WIDTH - RIGHT}" stroke="#5c6672" stroke-width=".05"/>'
                     f'<text x="{LEFT - .4}" y="{y + .4:g}" text-anchor="end">{force:g}</text>')
    parts.append(f'<text x=".1" y="{HEIGHT / 2:g}">N</text>')
    for k, (stamps, values) in enumerate(forces.values()):
        parts.append(f'<path class="force" data-pad="{k}" d="{_line(stamps - now, values, top)}" fill="none" '
                     f'stroke="{POINTS[k % len(POINTS)]}" stroke-width=".25"/>')
    return ''.join((*parts, '</svg>'))


def _line(times: np.ndarray, values: np.ndarray, top: float) -> str:
    line, last = [], -np.inf
    for time, value in zip(times.tolist(), values.tolist()):
        if value == value and -HISTORY <= time <= 0:
            line.append(f'{"L" if time - last < GAP else "M"}{_x(time):.2f} {_y(value, top):.2f}')
            last = time
    return ''.join(line)


def _x(time: float) -> float:
    return LEFT + (1 + time / HISTORY) * (WIDTH - LEFT - RIGHT)


def _y(force: float, top: float) -> float:
    return HEIGHT - BOTTOM - force / top * (HEIGHT - BOTTOM - TOP)
