"""Force over time (SVG), broken where there is none: a line across a gap would show what was not measured."""

from collections.abc import Mapping

import numpy as np

from tactile_node.colour_map import rounded_up
from tactile_node.viewing.pads_3d import POINT_COLOURS
from tactile_node.viewing.source import FORCE_HISTORY

FORCE_WIDTH, FORCE_HEIGHT = 60.0, 22.0
FORCE_LEFT, FORCE_RIGHT, FORCE_TOP, FORCE_BOTTOM = 4.0, 1.0, 1.0, 2.4
FORCE_GAP = 0.3     #: between two points, from which on they are not joined [s]
LEAST_FORCE_SCALE = 1.0   #: of the scale [N]
TIME_TICKS = -20, -15, -10, -5, 0


def force_chart(forces: Mapping[str, np.ndarray], now: float) -> str:
    """Return the chart; ``forces``: stamps [s] and forces [N] of each pad, (2, n); ``now``: stamp at the right end."""
    known = [values[1][np.isfinite(values[1])] for values in forces.values()]
    top = rounded_up(max([LEAST_FORCE_SCALE, *(float(each.max()) for each in known if len(each))]))
    parts = [f'<svg class="tactile-force" viewBox="0 0 {FORCE_WIDTH:g} {FORCE_HEIGHT:g}" font-size="1.2" '
             'fill="#5c6672">']
    for tick in TIME_TICKS:
        x = _x(tick)
        parts.append(f'<path d="M{x:g} {FORCE_TOP}V{FORCE_HEIGHT - FORCE_BOTTOM}" stroke="#5c6672" stroke-width=".03"/>'
                     f'<text x="{x:g}" y="{FORCE_HEIGHT - 1}" text-anchor="middle">{tick} s</text>')
    for force in (0.0, top / 2, top):
        y = _y(force, top)
        parts.append(f'<path d="M{FORCE_LEFT} {y:g}H{FORCE_WIDTH - FORCE_RIGHT}" stroke="#5c6672" stroke-width=".05"/>'
                     f'<text x="{FORCE_LEFT - .4}" y="{y + .4:g}" text-anchor="end">{force:g}</text>')
    parts.append(f'<text x=".1" y="{FORCE_HEIGHT / 2:g}">N</text>')
    for k, (stamps, values) in enumerate(forces.values()):
        parts.append(f'<path class="force" data-pad="{k}" d="{_line(stamps - now, values, top)}" fill="none" '
                     f'stroke="{POINT_COLOURS[k % len(POINT_COLOURS)]}" stroke-width=".25"/>')
    return ''.join((*parts, '</svg>'))


def _line(times: np.ndarray, values: np.ndarray, top: float) -> str:
    line, last = [], -np.inf
    for time, value in zip(times.tolist(), values.tolist()):
        if value == value and -FORCE_HISTORY <= time <= 0:
            line.append(f'{"L" if time - last < FORCE_GAP else "M"}{_x(time):.2f} {_y(value, top):.2f}')
            last = time
    return ''.join(line)


def _x(time: float) -> float:
    return FORCE_LEFT + (1 + time / FORCE_HISTORY) * (FORCE_WIDTH - FORCE_LEFT - FORCE_RIGHT)


def _y(force: float, top: float) -> float:
    return FORCE_HEIGHT - FORCE_BOTTOM - force / top * (FORCE_HEIGHT - FORCE_BOTTOM - FORCE_TOP)
