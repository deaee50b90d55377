"""Draw samples in bulk, as patches. One call draws hundreds of contacts from simulator.world and the figure pool.

The distributions are the same as in training.samples, which draws single contacts. The conditions ``cut``, ``second``
and ``rounding`` cannot be drawn in bulk and are omitted. This module adds cases that never occur for contacts in
general position: sides along the lattice, and frames without noise.
"""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.simulator.world import random_contact
from training.forms import STEPS as DISTANCE_STEPS
from training.forms import Forms
from training.patches import samples_of
from training.samples import LABELS, UNKNOWN, Samples

CIRCLE = LABELS.index('circle')
TRIANGLES = [LABELS.index(shape) for shape in ('right_triangle', 'isosceles_triangle')]
STEPS = 5  #: Number of points along each side of a taxel at which coverage is counted (STEPS x STEPS points).
EXACT = 0.12      #: Fraction of the contacts that are aligned exactly with the lattice, or at 45 degrees to it.
NOISELESS = 0.1   #: Fraction of the nominal pressure frames that have neither noise nor blur.
LIGHT = 0.3       #: Fraction of the pressure frames with a light contact, at 5 to 35 % of full scale.
NOISIEST = 0.25   #: Largest standard deviation of the noise, relative to the level of the contact.

#: Fraction of the pressure frames whose threshold ignores the level and the tilt of the contact.
ABSOLUTE = 0.35
MEMORY = 400_000  #: Maximum total number of taxels in a batch of frames.


class Covered(NamedTuple):
    """K contacts on a pad."""

    covered: np.ndarray  #: covered fraction of each taxel, (K, rows, cols)
    inside: np.ndarray   #: bool, True if the centre of a taxel is inside the contact, (K, rows, cols)
    areas: np.ndarray   #: areas of the contacts [taxels], (K,)
    labels: np.ndarray  #: (K,)


class Contacts:
    """K convex contacts. Each contact is given by half-planes or, for a circle, by a centre and a radius."""

    def __init__(self, rng: np.random.Generator, areas: np.ndarray, pad: int):
        self.labels = rng.integers(UNKNOWN, size=len(areas))
        drawn = [aligned(rng, contact) if rng.random() < EXACT else contact for contact in
                 (random_contact(rng, LABELS[label], area, rows=pad, cols=pad)
                  for label, area in zip(self.labels, areas))]
        self.areas = np.array([contact.area for contact in drawn])
        self.circle = np.array([(c.x, c.y, c.dimensions[0]) for c in drawn], np.float32)
        # the first corner of a triangle is repeated
        corners = np.array([np.resize(c.outline(4), (4, 2)) for c in drawn])
        edge = np.roll(corners, -1, axis=1) - corners
        edge[(edge == 0).all(-1)] = edge[(edge == 0).all(-1).nonzero()[0], 0]
        long = np.hypot(edge[..., 0], edge[..., 1])
        normal = np.stack((-edge[..., 1], edge[..., 0]), -1) / long[..., None]
        self.planes = np.dstack((normal, (normal * corners).sum(-1))).astype(np.float32)  # (K, 4, 3)
        lengths = np.where(np.isin(self.labels, TRIANGLES), long[:, :3].sum(1), long.sum(1))
        self.inner = np.where(self.labels == CIRCLE, self.circle[:, 2], 2 * self.areas / lengths)

    def depth(self, k, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the depth of points, (n, m), in the contacts with the indices ``k``, (n,)."""
        depth = np.full(x.shape, np.inf, np.float32)
        for side in range(4):
            plane = self.planes[k, side, :, None]
            np.minimum(depth, plane[:, 0] * x + plane[:, 1] * y - plane[:, 2], out=depth)
        disc = np.flatnonzero(self.labels[k] == CIRCLE)
        circle = self.circle[k][disc][..., None]
        depth[disc] = circle[:, 2] - np.hypot(x[disc] - circle[:, 0], y[disc] - circle[:, 1])
        return depth

    def on_pad(self, pad: int, wall: np.ndarray) -> Covered:
        """Return the contacts on a square pad. Only a rim of width ``wall``, (K,), remains of each contact."""
        count = len(self.labels)
        y, x = np.indices((pad, pad), np.float32).reshape(2, 1, -1)
        k = np.arange(count)
        x, y = (np.broadcast_to(a, (count, pad * pad)) for a in (x, y))
        depth = self.depth(k, x, y)
        depth = np.minimum(depth, wall[:, None] - depth)
        covered = (depth >= -1e-4).astype(np.float32)  # a centre on the outline counts as inside
        inside = covered.astype(bool).reshape(-1, pad, pad)
        k, at = np.nonzero(np.abs(depth) < 0.708)
        step = ((np.arange(STEPS) + 0.5) / STEPS - 0.5).astype(np.float32)
        dy, dx = (a.reshape(-1) for a in np.meshgrid(step, step, indexing='ij'))
        part = self.depth(k, x[0][at][:, None] + dx, y[0][at][:, None] + dy)
        covered[k, at] = (np.minimum(part, wall[k, None] - part) >= 0).mean(1)
        return Covered(covered.reshape(-1, pad, pad), inside, self.areas, self.labels)


def aligned(rng, contact):
    """Return ``contact`` aligned with the lattice.

    The angle becomes a multiple of 45 degrees, and the centre a multiple of half a taxel. Often, the side lengths
    become whole numbers.
    """
    half = [0.5 * rng.integers(-1, 2) for _ in range(2)]
    dimensions = contact.dimensions
    if rng.random() < 0.7:
        dimensions = tuple(max(round(size), 2.0) for size in dimensions[:2]) + dimensions[2:]
        if contact.shape == 'rectangle' and dimensions[0] < 1.4 * dimensions[1]:
            dimensions = contact.dimensions
        if contact.shape == 'circle':
            dimensions = (round(2 * contact.dimensions[0]) / 2,)
    angle = (np.pi / 4 if rng.random() < 0.3 else np.pi / 2) * rng.integers(8)
    middle = np.round((contact.x, contact.y))
    # the sides then lie on the borders between taxels
    if contact.shape in ('square', 'rectangle') and rng.random() < 0.6:
        half = [(round(size) % 2 - 1) / 2 for size in np.resize(dimensions, 2)[::1 if round(angle / np.pi * 2) % 2 == 0
                                                                              else -1]]
    return type(contact)(contact.shape, dimensions, x=float(middle[0] + half[0]), y=float(middle[1] + half[1]),
                         angle=float(angle))


def draw_many(rng: np.random.Generator, count: int, on_off: bool, areas: tuple[float, float] = (7, 60),
              faulty: float = 0.15, pad: int = 30) -> Samples:
    """Draw about ``count`` samples in bulk on a square pad with ``pad`` rows. The areas are log-uniform."""
    contacts = Contacts(rng, np.exp(rng.uniform(*np.log(areas), count)), pad)
    hollow = rng.random(count) < faulty
    wall = np.where(hollow, np.maximum(rng.uniform(0.2, 0.7, count) * contacts.inner, 1.25), 1e3).astype(np.float32)
    return pressed(rng, contacts.on_pad(pad, wall), on_off, faulty)


def draw_forms(rng: np.random.Generator, forms: Forms, areas: np.ndarray, on_off: bool, faulty: float = 0.15,
               pad: int = 36) -> Samples:
    """For each of K figures, draw a sample with the given ``areas``, (K,) [taxels], near the middle of a pad."""
    count = len(areas)
    x0, y0 = rng.uniform(-0.5, 0.5, (2, count)) + (pad - 1) / 2
    angle = rng.uniform(0, 2 * np.pi, count)
    angle = np.where(rng.random(count) < EXACT, np.round(angle / (np.pi / 2)) * np.pi / 2, angle)
    unit = np.sqrt(areas)
    y, x = np.indices((pad, pad), np.float32)
    u, v = x - x0[:, None, None], y - y0[:, None, None]
    cos, sin = ((f(angle) / unit / forms.cell)[:, None, None] for f in (np.cos, np.sin))
    col = forms.middle[:, 0, None, None] + u * cos + v * sin
    row = forms.middle[:, 1, None, None] + v * cos - u * sin
    depth = _interpolated(forms.distance, row, col) / DISTANCE_STEPS * unit[:, None, None]
    covered = np.clip(depth + 0.5, 0, 1).astype(np.float32)
    return pressed(rng, Covered(covered, depth >= 0, areas, forms.labels), on_off, faulty)


def _interpolated(images: np.ndarray, row: np.ndarray, col: np.ndarray) -> np.ndarray:
    """Return linear interpolations between the four nearest cells.

    Points beyond the raster are treated as far outside the figure.
    """
    last = images.shape[1] - 2
    outside = (row < 0) | (col < 0) | (row > last) | (col > last)
    row, col = np.clip(row, 0, last), np.clip(col, 0, last)
    r, c = row.astype(np.int32), col.astype(np.int32)
    fr, fc = row - r, col - c
    k = np.arange(len(images))[:, None, None]
    upper = images[k, r, c] * (1 - fc) + images[k, r, c + 1] * fc
    lower = images[k, r + 1, c] * (1 - fc) + images[k, r + 1, c + 1] * fc
    return np.where(outside, -127, upper * (1 - fr) + lower * fr)


def pressed(rng: np.random.Generator, contacts: Covered, on_off: bool, faulty: float) -> Samples:
    """Return samples of the contacts as a skin measures them.

    Each fault affects a fraction ``faulty`` of the contacts.
    """
    values, press = (_on_off if on_off else _graded)(rng, contacts, faulty)
    dead = _dead(rng, values.shape, on_off, faulty)
    return samples_of(rng, values, press, dead, labels=contacts.labels, graded=not on_off)


def _on_off(rng, contacts: Covered, faulty: float) -> tuple[np.ndarray, np.ndarray]:
    count = len(contacts.areas)
    drifted = rng.random(count) < faulty
    threshold = rng.uniform(0.2, 0.85, count)[:, None, None]
    values = np.where(drifted[:, None, None], contacts.covered >= threshold, contacts.inside).astype(np.float32)
    return _with_specks(rng, values, faulty), np.full((count, 1, 1), 0.5)


def _graded(rng, contacts: Covered, faulty: float) -> tuple[np.ndarray, np.ndarray]:
    """Return pressures and their thresholds. The pressures are about 1 under the contact."""
    count, shape = len(contacts.areas), contacts.covered.shape[1:]
    def either(low, high, worse):  # noqa: E306
        return np.where(rng.random(count) < faulty, rng.uniform(high, worse, count), rng.uniform(low, high, count))
    angle, tilt = rng.uniform(0, 2 * np.pi, count), either(0, 0.4, 0.8)
    pressure = np.where(rng.random(count) < LIGHT * (faulty > 0), np.exp(rng.uniform(*np.log((0.05, 0.35)), count)),
                        rng.uniform(0.35, 0.8, count))
    y, x = np.indices(shape, np.float32) - (shape[0] - 1) / 2
    unit = tilt / np.sqrt(contacts.areas / np.pi)
    rise = (np.cos(angle) * unit)[:, None, None] * x + (np.sin(angle) * unit)[:, None, None] * y
    values = contacts.covered * np.clip(1 + rise, 0, (1 / pressure)[:, None, None]).astype(np.float32)
    flat = rng.random(count) < ABSOLUTE
    silent = np.zeros(count, bool)
    for chosen in np.array_split(np.arange(count), 16):
        silent[chosen] = quiet = rng.random() < NOISELESS
        sigma = rng.uniform(0.5, 1.2) if rng.random() < faulty else 0.0 if quiet else rng.uniform(0.3, 0.7)
        values[chosen] = ndimage.gaussian_filter(values[chosen], (0, sigma, sigma), truncate=3.0)
    noise = np.where(silent, 0, np.minimum(either(0, 0.02, 0.08) / pressure, NOISIEST))
    values += noise[:, None, None].astype(np.float32) * rng.standard_normal(values.shape, np.float32)
    level = np.where(flat[:, None, None], 1, np.clip(1 + rise, 0.5, 1.5))
    # the library also requires three standard deviations
    relative = np.maximum(rng.uniform(0.38, 0.62, count), 3 * noise)
    press = np.where(flat, either(0.35, 0.7, 0.85), np.minimum(relative, 0.75))
    return _with_specks(rng, values, faulty), press[:, None, None] * level


def _with_specks(rng, values: np.ndarray, faulty: float) -> np.ndarray:
    count = len(values)
    specks = np.where(rng.random(count) < faulty, rng.uniform(0, 0.04, count), 0)[:, None, None]
    stuck = rng.random(values.shape, np.float32) < specks
    return np.where(stuck, rng.random(values.shape, np.float32) < 0.5, values)


def _dead(rng, shape, on_off: bool, faulty: float) -> np.ndarray:
    usual = 0.0 if on_off else rng.uniform(0, 0.06, shape[0])
    share = np.where(rng.random(shape[0]) < faulty, rng.uniform(0.03, 0.15, shape[0]), usual)
    return rng.random(shape, np.float32) < share[:, None, None]
