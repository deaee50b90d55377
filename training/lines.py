"""Draw foreign figures made of lines.

A network trained with few line figures mistakes lines for the broken rim of a hollow object.

Each figure is a bool array on a grid, with about unit size around the origin, like the figures in families.py. Outlines
with a gap are not included, because the rim of a real ring under silent columns also has gaps.
"""

import numpy as np
from scipy.interpolate import CubicSpline

from training.shapes import box, disc, polar, stroke

POINTS = 40  #: Number of points of a smooth line.


def _smooth(points: np.ndarray, closed: bool = False) -> np.ndarray:
    """Return a smooth line through ``points``, (POINTS, 2)."""
    if closed:
        points = np.concatenate((points, points[:1]))
    spline = CubicSpline(np.arange(len(points)), points, bc_type='periodic' if closed else 'natural')
    line = spline(np.linspace(0, len(points) - 1, POINTS))
    return line * 0.9 / max(0.9, np.abs(line).max())


def scrawl(rng, x, y):
    """Return a smooth line that may cross itself."""
    points = rng.uniform(-0.8, 0.8, (rng.integers(3, 8), 2))
    return stroke(x, y, _smooth(points), rng.uniform(0.12, 0.35))


def loop_with_tail(rng, x, y):
    """Return a closed line of any form, filled or not, with a second line starting on it."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, 5)) + np.arange(5) * 0.2
    loop, width = _smooth(0.5 * polar(np.column_stack((angle, rng.uniform(0.5, 1, 5)))), closed=True), \
        rng.uniform(0.12, 0.3)
    start = loop[rng.integers(POINTS)]
    tail = np.array([start, start * 1.5 + rng.uniform(-0.3, 0.3, 2), rng.uniform(-0.9, 0.9, 2)])
    return stroke(x, y, loop, width) | stroke(x, y, _smooth(tail), width)


def branches(rng, x, y):
    """Return a trunk with two to five straight branches at random places and in random directions."""
    width, turn = rng.uniform(0.12, 0.35), rng.uniform(-0.5, 0.5)
    found = stroke(x, y, np.array([(-0.9, 0), (0.9, 0)]), width)
    for _ in range(rng.integers(2, 6)):
        foot, side = np.array((rng.uniform(-0.85, 0.85), 0)), rng.choice((-1, 1))
        angle = side * (np.pi / 2 + turn * rng.uniform(0.5, 1.5))
        tip = foot + rng.uniform(0.3, 0.9) * np.array((np.cos(angle), np.sin(angle)))
        found |= stroke(x, y, np.array([foot, tip]), width * rng.choice((1.0, rng.uniform(0.6, 1.2))))
    return found


def zigzag(rng, x, y):
    """Return a wave of 1.5 to 5 half-waves, either sharp or round."""
    along = np.linspace(-1, 1, POINTS)
    phase = along * rng.uniform(1.5, 5) * np.pi / 2 + rng.uniform(0, np.pi)
    wave = np.sin(phase) if rng.random() < 0.5 else 2 / np.pi * np.arcsin(np.sin(phase))
    line = np.column_stack((0.85 * along, rng.uniform(0.2, 0.8) * wave))
    return stroke(x, y, line, rng.uniform(0.12, 0.4))


def grid(rng, x, y):
    """Return one to three bars in one direction and one to three bars in another direction. The bars meet or cross."""
    found, lean = np.zeros(x.shape, bool), rng.choice((0.0, rng.uniform(-0.4, 0.4)))
    x = x + lean * y
    for across, count in ((False, rng.integers(1, 4)), (True, rng.integers(1, 4))):
        u, v = (y, x) if across else (x, y)
        width, reach = rng.uniform(0.05, 0.16), rng.uniform(0.5, 0.9)
        for at in np.linspace(-0.5, 0.5, count) if count > 1 else rng.uniform(-0.5, 0.5, 1):
            ends = (-reach, reach) if rng.random() < 0.6 else (rng.uniform(-0.9, -0.4), rng.uniform(0.4, 0.9))
            found |= box(u, v, *ends, at - width, at + width)
    return found


def beads(rng, x, y):
    """Return touching discs along a smooth line, as a chain of constant or growing width."""
    line, size = _smooth(rng.uniform(-0.75, 0.75, (rng.integers(3, 6), 2))), rng.uniform(0.1, 0.25)
    swell = rng.uniform(0, 0.6) * np.sin(np.linspace(0, rng.uniform(2, 12), POINTS))
    found = np.zeros(x.shape, bool)
    for (x0, y0), by in zip(line, swell):
        found |= disc(x, y, size * (1 + by), x0, y0)
    return found


LINES = {figure.__name__: figure for figure in (
    scrawl, loop_with_tail, branches, zigzag, grid, beads)}
