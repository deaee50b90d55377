"""Samples in bulk: the contacts of synthetic.world, hundreds at a time, straight to patches.

The same distributions as training.samples draws one by one, for those conditions that can be drawn in
bulk (all but cut, second and rounded contacts, outliers, and contacts too wide for a patch).
"""

import numpy as np
from scipy import ndimage

from tactile_node.shape.invariants import describe_all
from tactile_node.shape.patch import BRIDGED, RIM, ROOM, SIDE
from tactile_node.synthetic.world import random_contact
from training.samples import LABELS, LEVEL_STEPS, SMALLEST, UNKNOWN, Samples

CIRCLE = LABELS.index('circle')
TRIANGLES = [LABELS.index(shape) for shape in ('right_triangle', 'isosceles_triangle')]
PAD = 30
CELLS = np.arange(SIDE)
STEPS = 5  #: coverage is counted on STEPS x STEPS points
PLANE = np.ones((1, 3, 3), np.uint8)
FLAT = np.pad(np.ones((1, 3, 3), bool), ((1, 1), (0, 0), (0, 0)))


class Contacts:
    """K convex contacts by their half-planes (circles: by one distance)."""

    def __init__(self, rng: np.random.Generator, count: int, areas: np.ndarray):
        self.labels = rng.integers(UNKNOWN, size=count)
        drawn = [random_contact(rng, LABELS[label], area, rows=PAD, cols=PAD)
                 for label, area in zip(self.labels, areas)]
        self.circle = np.array([(c.x, c.y, c.dimensions[0]) for c in drawn], np.float32)
        corners = np.array([np.resize(c.outline(4), (4, 2)) for c in drawn])  # a triangle's first one twice
        edge = np.roll(corners, -1, axis=1) - corners
        edge[(edge == 0).all(-1)] = edge[(edge == 0).all(-1).nonzero()[0], 0]
        long = np.hypot(edge[..., 0], edge[..., 1])
        normal = np.stack((-edge[..., 1], edge[..., 0]), -1) / long[..., None]
        self.planes = np.dstack((normal, (normal * corners).sum(-1))).astype(np.float32)  # (K, 4, 3)
        lengths = np.where(np.isin(self.labels, TRIANGLES), long[:, :3].sum(1), long.sum(1))
        self.inner = np.where(self.labels == CIRCLE, self.circle[:, 2], 2 * areas / lengths)

    def depth(self, k, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Depth of points (n, m) in contacts ``k``, (n,)."""
        depth = np.full(x.shape, np.inf, np.float32)
        for side in range(4):
            plane = self.planes[k, side, :, None]
            np.minimum(depth, plane[:, 0] * x + plane[:, 1] * y - plane[:, 2], out=depth)
        disc = np.flatnonzero(self.labels[k] == CIRCLE)
        circle = self.circle[k][disc][..., None]
        depth[disc] = circle[:, 2] - np.hypot(x[disc] - circle[:, 0], y[disc] - circle[:, 1])
        return depth


def coverages(contacts: Contacts, wall: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Covered fraction of every taxel and whether its centre is inside, (K, PAD, PAD)."""
    count = len(contacts.labels)
    y, x = np.indices((PAD, PAD), np.float32).reshape(2, 1, -1)
    k = np.arange(count)
    x, y = (np.broadcast_to(a, (count, PAD * PAD)) for a in (x, y))
    depth = contacts.depth(k, x, y)
    depth = np.minimum(depth, wall[:, None] - depth)
    covered = (depth >= 0).astype(np.float32)
    inside = covered.astype(bool).reshape(-1, PAD, PAD)
    k, at = np.nonzero(np.abs(depth) < 0.708)
    step = ((np.arange(STEPS) + 0.5) / STEPS - 0.5).astype(np.float32)
    dy, dx = (a.reshape(-1) for a in np.meshgrid(step, step, indexing='ij'))
    part = contacts.depth(k, x[0][at][:, None] + dx, y[0][at][:, None] + dy)
    covered[k, at] = (np.minimum(part, wall[k, None] - part) >= 0).mean(1)
    return covered.reshape(-1, PAD, PAD), inside


def draw_many(rng: np.random.Generator, count: int, on_off: bool, areas: tuple[float, float] = (7, 60),
              faulty: float = 0.15) -> Samples:
    """Draw about ``count`` samples in bulk, the areas log-uniform."""
    area = np.exp(rng.uniform(*np.log(areas), count))
    contacts = Contacts(rng, count, area)
    hollow = rng.random(count) < faulty
    wall = np.where(hollow, np.maximum(rng.uniform(0.2, 0.7, count) * contacts.inner, 1.25), 1e3).astype(np.float32)
    covered, inside = coverages(contacts, wall)
    values, press = (_on_off if on_off else _graded)(rng, covered, inside, area=area, faulty=faulty)
    dead = _dead(rng, count, on_off, faulty)
    return _patches(values, press, dead, labels=contacts.labels, graded=not on_off)


def _on_off(rng, covered, inside, area, faulty) -> tuple[np.ndarray, np.ndarray]:
    drifted = rng.random(len(area)) < faulty
    threshold = rng.uniform(0.2, 0.85, len(area))[:, None, None]
    values = np.where(drifted[:, None, None], covered >= threshold, inside).astype(np.float32)
    specks = np.where(rng.random(len(area)) < faulty, rng.uniform(0, 0.04, len(area)), 0)[:, None, None]
    stuck = rng.random(values.shape, np.float32) < specks
    return np.where(stuck, rng.random(values.shape, np.float32) < 0.5, values), np.full(len(area), 0.5)


def _graded(rng, covered, inside, area, faulty) -> tuple[np.ndarray, np.ndarray]:
    """Pressures with level about 1 under the contact."""
    count = len(area)
    def either(low, high, worse):  # noqa: E306
        return np.where(rng.random(count) < faulty, rng.uniform(high, worse, count), rng.uniform(low, high, count))
    angle, tilt, pressure = rng.uniform(0, 2 * np.pi, count), either(0, 0.4, 0.8), rng.uniform(0.35, 0.8, count)
    y, x = np.indices((PAD, PAD), np.float32) - (PAD - 1) / 2
    unit = tilt / np.sqrt(area / np.pi)
    rise = (np.cos(angle) * unit)[:, None, None] * x + (np.sin(angle) * unit)[:, None, None] * y
    values = covered * np.clip(1 + rise, 0, (1 / pressure)[:, None, None]).astype(np.float32)
    for chosen in np.array_split(np.arange(count), 16):
        sigma = rng.uniform(0.5, 1.2) if rng.random() < faulty else rng.uniform(0.3, 0.7)
        values[chosen] = ndimage.gaussian_filter(values[chosen], (0, sigma, sigma), truncate=3.0)
    noise = either(0, 0.02, 0.08) / pressure
    values += noise[:, None, None].astype(np.float32) * rng.standard_normal(values.shape, np.float32)
    specks = np.where(rng.random(count) < faulty, rng.uniform(0, 0.04, count), 0)[:, None, None]
    stuck = rng.random(values.shape, np.float32) < specks
    return np.where(stuck, rng.random(values.shape, np.float32) < 0.5, values), either(0.4, 0.75, 0.85)


def _dead(rng, count, on_off, faulty) -> np.ndarray:
    usual = 0.0 if on_off else rng.uniform(0, 0.06, count)
    share = np.where(rng.random(count) < faulty, rng.uniform(0.03, 0.15, count), usual)
    return rng.random((count, PAD, PAD), np.float32) < share[:, None, None]


def _patches(values, press, dead, labels, graded) -> Samples:
    pressed = (values >= press[:, None, None]) & ~dead
    parts, found = ndimage.label(pressed, FLAT)
    sizes = np.bincount(parts.reshape(-1), minlength=found + 1)
    sizes[0] = 0
    largest = parts.reshape(len(labels), -1)
    main = largest[np.arange(len(labels)), sizes[largest].argmax(1)]
    wide = ndimage.maximum_filter(pressed.view(np.uint8), (1, BRIDGED + 1, BRIDGED + 1), mode='constant')
    groups, _ = ndimage.label(wide, FLAT)
    which = np.where(parts == main[:, None, None], groups, 0).reshape(len(labels), -1).max(1)
    mask = pressed & (groups == which[:, None, None])
    low, extent = _bounds(mask)
    good = (sizes[main] >= SMALLEST) & (main > 0) & (extent.max(1) <= ROOM)
    return _placed(values[good], mask[good], dead[good], low=low[good], extent=extent[good], labels=labels[good],
                   graded=graded)


def _bounds(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    spans = [mask.any(2), mask.any(1)]
    low = np.column_stack([span.argmax(1) for span in spans])
    high = np.column_stack([PAD - span[:, ::-1].argmax(1) for span in spans])
    return low, high - low


def _placed(values, mask, dead, low, extent, labels, graded) -> Samples:
    known = np.where(dead, 0, values)
    if graded:
        inside = known * mask
        scale = inside.sum((1, 2)) / np.square(inside).sum((1, 2))
        near = ndimage.maximum_filter(mask.view(np.uint8), (1, 2 * RIM + 1, 2 * RIM + 1), mode='constant')
        level = known * near * scale[:, None, None]
    else:
        level = mask.astype(float)
    valid = (~dead).astype(float)
    sums, seen = (ndimage.uniform_filter(a, (1, 3, 3), mode='constant') for a in (level * valid, valid))
    level = np.where(dead, sums / np.maximum(seen, 1 / 9), level)
    start = low - (SIDE - extent) // 2
    row, col = (start[:, axis, None] + np.arange(SIDE) for axis in (0, 1))
    at = np.arange(len(labels))[:, None, None], row[:, :, None] + SIDE, col[:, None, :] + SIDE
    room = ((0, 0), (SIDE, SIDE), (SIDE, SIDE))
    # A patch shows RIM taxels around the contact's box, as make_patch crops it; the rest is as a pad without contact.
    around = [(a >= first[:, None] - RIM) & (a < first[:, None] + size[:, None] + RIM)
              for a, first, size in ((row, low[:, 0], extent[:, 0]), (col, low[:, 1], extent[:, 1]))]
    shown = around[0][:, :, None] & around[1][:, None, :]
    levels = np.where(shown, np.pad(level, room)[at], 0)
    unseen = np.where(shown, np.pad(dead, room)[at], 1).astype(float)
    levels, unseen = _standing(levels.astype(np.float32), unseen.astype(np.float32), extent % 2)
    geometry = describe_all(levels, unseen, np.ones(len(labels)))
    return Samples(np.clip(levels * LEVEL_STEPS + 0.5, 0, 255).astype(np.uint8),
                   (unseen * 255).astype(np.uint8), geometry, labels)


def _standing(levels: np.ndarray, unseen: np.ndarray, odd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each of K patches' eight rotations and reflections: longer along x, more spread to greater x and y.

    ``odd``: (K, 2), 1 where the contact is an odd number of cells high, wide: half a cell off the middle.
    """
    (xx, xxx), (yy, yyy) = _spread(levels.sum(1)), _spread(levels.sum(2))
    rows, cols = (np.where(skew[:, None] < 0, (SIDE - 1 - off[:, None] - CELLS) % SIDE, CELLS)
                  for skew, off in ((yyy, odd[:, 0]), (xxx, odd[:, 1])))
    lying = (yy > xx)[:, None, None]
    rows, cols = np.where(lying, rows[:, None, :], rows[:, :, None]), np.where(lying, cols[:, :, None],
                                                                               cols[:, None, :])
    k = np.arange(len(levels))[:, None, None]
    return levels[k, rows, cols], unseen[k, rows, cols]


def _spread(weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Second and third central moments of K distributions (K, SIDE) along one axis."""
    place = CELLS - (weight @ CELLS / weight.sum(1))[:, None]
    square = weight * place * place
    return square.sum(1), (square * place).sum(1)
