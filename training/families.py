"""Draw foreign figures for training, by family.

The families of the reported figures are not in this module or any other training module.

A figure is a bool array on a grid. A figure has about unit size and lies around the origin. The position, angle and
size of a figure are drawn later. The familiarity of a figure depends on its overlap with the five shapes (forms.py),
not on its family. A hexagon, for example, is nearly a circle.
"""

import numpy as np
from scipy import ndimage

from training.lines import LINES
from training.outliers import FORMS, TRAINED
from training.shapes import Figure, box, disc, inside, polar, stroke


def comb(rng, x, y):
    """Return a comb, which is a bar with two to five teeth."""
    teeth, back = rng.integers(2, 6), rng.uniform(0.2, 0.5)
    share, height = rng.uniform(0.35, 0.7), rng.uniform(0.5, 1.1)
    pitch = 1.4 / (teeth - 1 + share)
    found = box(x, y, -0.7, 0.7, -height / 2, -height / 2 + back * height)
    for tooth in range(teeth):
        found |= box(x, y, -0.7 + tooth * pitch, -0.7 + (tooth + share) * pitch, -height / 2, height / 2)
    return found


def ring_sector(rng, x, y):
    """Return a part of a ring, from an eighth of the ring to nearly all of it."""
    hole, opening = rng.uniform(0.35, 0.8), rng.uniform(0.25, 1.75) * np.pi
    return disc(x, y, 1) & ~disc(x, y, hole) & (np.arctan2(y, x) % (2 * np.pi) <= opening)


def arrow(rng, x, y):
    head, wide, shaft = rng.uniform(0.4, 0.9), rng.uniform(0.35, 0.8), rng.uniform(0.1, 0.3)
    notch = rng.uniform(-0.2, 0.3) * head
    return inside(x, y, np.array([(1, 0), (1 - head, wide), (1 - head + notch, shaft), (-0.8, shaft), (-0.8, -shaft),
                                  (1 - head + notch, -shaft), (1 - head, -wide)]))


def kite(rng, x, y):
    """Return a kite, a rhombus or a dart."""
    wide, at = rng.uniform(0.3, 0.9), rng.uniform(-0.9, 0.8)
    return inside(x, y, np.array([(1, 0), (at, wide), (-1 if rng.random() < 0.7 else at + 0.35, 0), (at, -wide)]))


def regular(rng, x, y):
    """Return a regular polygon with five to eight corners.

    Sometimes the corners are moved or the polygon is stretched.
    """
    corners = rng.integers(5, 9)
    angle = np.arange(corners) * 2 * np.pi / corners
    points = polar(np.column_stack((angle, np.ones(corners))))
    points += rng.choice((0.0, 0.06, 0.2)) * rng.standard_normal(points.shape)
    return inside(x, y, points * (1, rng.choice((1.0, rng.uniform(0.45, 1)))))


def parallelogram(rng, x, y):
    high, lean = rng.uniform(0.25, 0.9), rng.uniform(0.15, 1.2)
    return inside(x, y, np.array([(-0.8 - lean / 2, -high), (0.8 - lean / 2, -high), (0.8 + lean / 2, high),
                                  (-0.8 + lean / 2, high)]) * 0.8)


def trapezium(rng, x, y):
    top, lean, high = rng.uniform(0.2, 0.85), rng.uniform(-0.5, 0.5), rng.uniform(0.3, 0.9)
    return inside(x, y, np.array([(-0.9, -high), (0.9, -high), (lean + 0.9 * top, high), (lean - 0.9 * top, high)]))


def scalene(rng, x, y):
    """Return a triangle or a quadrangle with random corners."""
    corners = rng.integers(3, 5)
    angle = np.sort(rng.uniform(0, 2 * np.pi, corners))
    return inside(x, y, polar(np.column_stack((angle, rng.uniform(0.7, 1.2, corners)))))


def sector(rng, x, y):
    """Return a quarter, a half or another part of a disc, cut from the centre or along a straight line."""
    if rng.random() < 0.5:
        return disc(x, y, 1) & (np.arctan2(y, x) % (2 * np.pi) <= rng.uniform(0.2, 1.7) * np.pi)
    return disc(x, y, 1) & (x >= rng.uniform(-0.7, 0.5))


def teardrop(rng, x, y):
    """Return a disc with a pointed end."""
    tip, radius = rng.uniform(1.15, 2.4), rng.uniform(0.4, 0.6)
    tip *= radius
    touch = radius * radius / tip
    across = np.sqrt(radius ** 2 - touch ** 2)
    x = x + tip / 2 - radius / 2
    return disc(x, y, radius) | inside(x, y, np.array([(tip, 0), (touch, across), (touch, -across)]))


def pair(rng, x, y):
    """Return two simple figures that touch or overlap slightly.

    The figures are alike or different and have any relative size.
    """
    parts, sizes = [], (0.5, rng.uniform(0.2, 0.5))
    away = rng.uniform(0, 2 * np.pi)
    for k, size in enumerate(sizes):
        angle, kind = rng.uniform(0, 2 * np.pi), rng.integers(4)
        middle = k * sum(sizes) * rng.uniform(0.7, 1.15)
        xk, yk = x + 0.3 - middle * np.cos(away), y - middle * np.sin(away)
        u, v = xk * np.cos(angle) + yk * np.sin(angle), yk * np.cos(angle) - xk * np.sin(angle)
        half = size * rng.uniform(0.4, 1)
        parts.append((disc(u, v, size), box(u, v, -size, size, -half, half), box(u, v, -size, size, -size, size),
                      inside(u, v, size * 1.2 * polar([(a, 1) for a in (0, 2.1, 4.0)])))[kind])
    return parts[0] | parts[1]


def curve(rng, x, y):
    """Return an outline whose radius is a sum of random harmonics, from a slightly uneven disc to pronounced lobes."""
    order = np.arange(2, rng.integers(4, 12))
    weight = rng.standard_normal(len(order)) / order ** rng.uniform(0.2, 1.5)
    weight *= rng.uniform(0.05, 0.45) * np.sqrt(2) / np.linalg.norm(weight)
    angle, phase = np.arctan2(y, x), rng.uniform(0, 2 * np.pi, len(order))
    radius = 1 + sum(w * np.cos(k * angle + p) for w, k, p in zip(weight, order, phase))
    return np.hypot(x, y) <= np.clip(radius, 0.15, 1.9) * 0.75


def polyomino(rng, x, y):
    """Return three to seven squares joined side by side at random."""
    cells, count = {(0, 0)}, rng.integers(3, 8)
    while len(cells) < count:
        row, col = list(cells)[rng.integers(len(cells))]
        cells.add([(row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)][rng.integers(4)])
    middle, unit = np.mean(list(cells), 0), 1.5 / np.sqrt(count) * rng.uniform(0.6, 0.8)
    aspect = rng.choice((1.0, rng.uniform(0.6, 1.6)))
    return np.any([box(x / unit, y / unit / aspect, col - 0.501, col + 0.501, row - 0.501, row + 0.501)
                   for row, col in np.array(list(cells)) - middle], axis=0)


def strokes(rng, x, y):
    """Return a random line with one to four bends, thick or thin, sometimes with a second line across it."""
    width, found = rng.uniform(0.15, 0.45), np.zeros(x.shape, bool)
    for _ in range(rng.integers(1, 3)):
        found |= stroke(x, y, rng.uniform(-0.9, 0.9, (rng.integers(2, 6), 2)), width)
    return found


def stadium(rng, x, y):
    """Return a box with rounded or cut corners.

    Rounded boxes range from nearly a rectangle to two half discs with a box between them.
    """
    long, high = 1.0, rng.uniform(0.3, 1.0)
    by = rng.uniform(0.2, 1) * high
    if rng.random() < 0.3:
        cut = np.abs(x) + np.abs(y) <= long + high - by
        return box(x, y, -long, long, -high, high) & cut
    u, v = np.maximum(np.abs(x) - (long - by), 0), np.maximum(np.abs(y) - (high - by), 0)
    return (np.hypot(u, v) <= by) & (np.abs(x) <= long) & (np.abs(y) <= high)


def oval(rng, x, y):
    """Return an egg, or an ellipse with an axis ratio of 1.15 to 3.5."""
    ratio, egg = rng.uniform(1.15, 3.5), rng.choice((0.0, rng.uniform(0, 0.5)))
    return (x / 1.1) ** 2 + (y * ratio / 1.1) ** 2 * (1 + egg * x) <= 1


def ragged(rng, x, y):
    """Return the largest piece of filtered noise above a level. This piece has an arbitrary outline."""
    noise = ndimage.gaussian_filter(rng.standard_normal(x.shape), len(x) * rng.uniform(0.03, 0.12))
    noise = noise / noise.std() - rng.uniform(0.8, 2.5) * (x * x + y * y)
    labels, _ = ndimage.label(noise > rng.uniform(-0.6, 0.3))
    sizes = np.bincount(labels.reshape(-1))
    sizes[0] = 0
    return labels == sizes.argmax()


def perforated(rng, x, y):
    """Return a disc, a box or a triangle with one to five holes or bites at random places."""
    whole = (disc(x, y, 0.9), box(x, y, -0.9, 0.9, -0.6, 0.6), inside(x, y, polar([(a, 1.1) for a in (0, 2.1, 4.2)])))
    found = whole[rng.integers(3)]
    for _ in range(rng.integers(1, 6)):
        found = found & ~disc(x, y, rng.uniform(0.15, 0.4), *rng.uniform(-0.8, 0.8, 2))
    return found


def _of_outlier(kind: str) -> Figure:
    return lambda rng, x, y: FORMS[kind](rng)(x, y) >= 0


FAMILIES: dict[str, Figure] = {
    **{kind: _of_outlier(kind) for kind in TRAINED},
    **{figure.__name__: figure for figure in (
        comb, ring_sector, arrow, kite, regular, parallelogram, trapezium, scalene, sector, teardrop, pair, curve,
        polyomino, strokes, stadium, oval, ragged, perforated)},
    **LINES}
