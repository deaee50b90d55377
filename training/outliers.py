"""Draw contacts outside the five shapes, in general position. A recogniser must call these contacts unknown.

The contacts are used for training and for choosing thresholds. The reported rejection is measured with families that
use different code and parameters (bench/recognition/foreign.py). The scale of each figure is found by counting its
area, so that each figure has the required area.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tactile_node.pose.outlines import depth_inside

#: Function that returns the depth of points in a figure of about unit size at the origin.
Depth = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Outlier:
    """One contact whose shape is none of the five [pitches, radians]."""

    kind: str
    form: Depth
    scale: float
    x: float
    y: float
    angle: float
    reach: float

    def depth(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return a lower bound on the distance from the outline, positive inside."""
        cos, sin = np.cos(self.angle) / self.scale, np.sin(self.angle) / self.scale
        u, v = x - self.x, y - self.y
        return self.scale * self.form(u * cos + v * sin, v * cos - u * sin)


def random_outlier(rng: np.random.Generator, kind: str, area: float, rows: int, cols: int) -> Outlier:
    """Draw a contact with the given ``kind`` and ``area`` [taxels] in general position, in the middle of a pad."""
    form = FORMS[kind](rng)
    y, x = GRID
    inside = form(x, y) >= 0
    if not inside.any():
        return random_outlier(rng, kind, area, rows=rows, cols=cols)
    scale = np.sqrt(area / (inside.sum() * STEP ** 2))
    middle = x[inside].mean(), y[inside].mean()
    reach = np.hypot(x[inside] - middle[0], y[inside] - middle[1]).max() * scale + 1
    centred = lambda u, v: form(u + middle[0], v + middle[1])  # noqa: E731
    x0, y0 = rng.uniform(-0.5, 0.5, 2) + ((cols - 1) / 2, (rows - 1) / 2)
    return Outlier(kind, centred, scale=float(scale), x=float(x0), y=float(y0),
                   angle=float(rng.uniform(0, 2 * np.pi)), reach=float(reach))


STEP = 0.05
GRID = np.mgrid[-2:2:STEP, -2:2:STEP] + STEP / 2
GRID.flags.writeable = False


def _box(x0: float, x1: float, y0: float, y1: float) -> Depth:
    return lambda x, y: np.minimum(np.minimum(x - x0, x1 - x), np.minimum(y - y0, y1 - y))


def _disc(x0: float, y0: float, radius: float) -> Depth:
    return lambda x, y: radius - np.hypot(x - x0, y - y0)


def _union(parts: list[Depth]) -> Depth:
    return lambda x, y: np.max([part(x, y) for part in parts], axis=0)


def _without(whole: Depth, part: Depth) -> Depth:
    return lambda x, y: np.minimum(whole(x, y), -part(x, y))


def _ellipse(a: float, b: float, power: float = 2.0) -> Depth:
    steepest = min(0.7, 0.4 * power) * min(a, b)
    return lambda x, y: steepest * (1 - (np.abs(x / a) ** power + np.abs(y / b) ** power) ** (1 / power))


def _radial(radius: Callable[[np.ndarray], np.ndarray]) -> Depth:
    """Return a figure whose outline is given by the radius as a function of the angle.

    The slope of the radius must stay below about 3.
    """
    return lambda x, y: 0.3 * (radius(np.arctan2(y, x)) - np.hypot(x, y))


def _convex(corners: np.ndarray) -> Depth:
    return lambda x, y: depth_inside(corners, x, y)


def bars(rng: np.random.Generator) -> Depth:
    """Return two or three bars that meet: T, U, Z, H, L or a cross."""
    w, at = rng.uniform(0.22, 0.5, 3), rng.uniform(0, 1, 2)
    long = rng.uniform(0.6, 1.0, 2)
    parts = [_box(0, 1, 0, w[0])]
    for width, place, length in zip(w[1:1 + rng.integers(1, 3)], at, long):
        left = place * (1 - width)
        below = rng.choice((0.0, rng.uniform(0, 1))) * (length - w[0])
        parts.append(_box(left, left + width, -below, length - below))
    return _union(parts)


def star(rng: np.random.Generator) -> Depth:
    """Return a star with three to six rays, wavy or sharp."""
    rays, depth, phase = rng.integers(3, 7), rng.uniform(0.2, 0.45), rng.uniform(0, 2 * np.pi)
    wave = (lambda a: np.cos(a)) if rng.random() < 0.5 else (lambda a: 1 - 2 * np.abs((a / np.pi) % 2 - 1))
    return _radial(lambda a: 1 + depth * wave(rays * a + phase))


def lens(rng: np.random.Generator) -> Depth:
    """Return a disc with a part cut out by another disc, or the intersection of two discs.

    A cut disc is, for example, a moon, a bitten disc or a half disc.
    """
    a, b = _disc(0, 0, 1), _disc(rng.uniform(0.3, 1.1), 0, rng.uniform(0.5, 1.2))
    if rng.random() < 0.75:
        return _without(a, b)
    return lambda x, y: np.minimum(a(x, y), _disc(0.9, 0, 1)(x, y))


def ellipses(rng: np.random.Generator) -> Depth:
    ratio = rng.uniform(1.4, 2.6)
    return _ellipse(ratio ** 0.5, ratio ** -0.5)


def superellipse(rng: np.random.Generator) -> Depth:
    """Return a superellipse that is like a stadium (power 2 to 2.6, ratio above 1.4) or pinched (power below 1)."""
    if rng.random() < 0.5:
        ratio = rng.uniform(1.4, 2.6)
        return _ellipse(ratio ** 0.5, ratio ** -0.5, rng.uniform(2.0, 2.6))
    ratio = rng.uniform(1, 2)
    return _ellipse(ratio ** 0.5, ratio ** -0.5, rng.uniform(0.5, 0.8))


def discs(rng: np.random.Generator) -> Depth:
    """Return two to five discs of random size, each touching the previous one."""
    x, y, radius = 0.0, 0.0, 0.45
    parts = [_disc(x, y, radius)]
    for _ in range(rng.integers(1, 5)):
        angle, radius = rng.uniform(0, 2 * np.pi), rng.uniform(0.25, 0.5)
        x, y = x + 0.6 * np.cos(angle), y + 0.6 * np.sin(angle)
        parts.append(_disc(x, y, radius))
    return _union(parts)


def polygon(rng: np.random.Generator) -> Depth:
    """Return a non-convex polygon with five to eight corners at random radii."""
    corners = rng.integers(5, 9)
    angle = (np.arange(corners + 1) + np.append(rng.uniform(-0.3, 0.3, corners), 0)) * 2 * np.pi / corners
    radius = rng.uniform(0.45, 1.2, corners + 1)
    angle[-1], radius[-1] = angle[0] + 2 * np.pi, radius[0]
    x, y = radius * np.cos(angle), radius * np.sin(angle)

    def outline(a):
        a = (a - angle[0]) % (2 * np.pi) + angle[0]
        k = np.clip(np.searchsorted(angle, a, side='right') - 1, 0, corners - 1)
        dx, dy = x[k + 1] - x[k], y[k + 1] - y[k]
        return (x[k] * dy - y[k] * dx) / np.maximum(np.cos(a) * dy - np.sin(a) * dx, 0.05)
    return _radial(outline)


def notched(rng: np.random.Generator) -> Depth:
    """Return a rectangle or a triangle with a large notch, a trapezium or a parallelogram."""
    if rng.random() < 0.4:
        top, lean = rng.uniform(0.3, 0.65), rng.uniform(-0.3, 0.6)
        height = rng.uniform(0.5, 0.9)
        return _convex(np.array([[0, 0], [1, 0], [lean + top, height], [lean, height]]))
    whole = _box(0, 1, 0, rng.uniform(0.5, 1))
    if rng.random() < 0.4:
        whole = _convex(np.array([[0, 0], [1, 0], [rng.uniform(0, 1), rng.uniform(0.6, 1)]]))
    return _without(whole, _disc(rng.uniform(0.2, 0.8), rng.choice((0.0, 0.5)), rng.uniform(0.2, 0.3)))


FORMS: dict[str, Callable[[np.random.Generator], Depth]] = {
    'bars': bars, 'star': star, 'lens': lens, 'ellipses': ellipses, 'superellipse': superellipse, 'discs': discs,
    'polygon': polygon, 'notched': notched}
TRAINED = tuple(FORMS)
