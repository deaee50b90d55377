"""Known shapes with a blemish, which must still be recognised.

The training must not import this module.

Each blemished figure overlaps its clean shape by at least KEPT, and resembles this shape more than the other four.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import ndimage

from bench.recognition.stamp import Drawing, Stamp, cropped, drawn, points
from tactile_node.simulator.world import Contact, random_contact
from training.ground_truth.overlap import Limits

KEPT = 0.92      #: Smallest overlap of a blemished figure with its clean shape.
SPOILED = 0.02   #: Smallest loss of overlap due to the blemish.
AREA = 0.5       #: Area of a figure within its square of 2 x 2.

#: Ranges of the aspect ratios and apex angles of the five shapes.
LIMITS = Limits(ratio=(1.5, 3), legs=(1.5, 2.5), apex=(40, 75))

#: Function that adds a blemish to the filled figure of a contact.
Blemish = Callable[[np.random.Generator, Contact, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def bank(rng: np.random.Generator, kind: str, drawing: Drawing, shape: str, count: int) -> list[Stamp]:
    """Draw ``count`` figures of ``shape`` with a blemish of ``kind``."""
    stamps: list[Stamp] = []
    while len(stamps) < count:
        stamp = drawn(kind, rng, drawing, LIMITS)
        if stamp.shape == shape and stamp.overlap >= KEPT:
            stamps.append(stamp)
    return stamps


def whole(rng: np.random.Generator, shape: str) -> Stamp:
    """Draw a figure of ``shape`` without a blemish."""
    return Stamp('known', cropped(_middle(rng, shape).depth(*points()) >= 0), shape, 1.0)


def _middle(rng: np.random.Generator, shape: str) -> Contact:
    return replace(random_contact(rng, shape, AREA, rows=1, cols=1), x=0.0, y=0.0)


def reported(kind: str, shape: str) -> Drawing:
    """Return a function that draws figures of ``shape`` with a blemish of ``kind`` from BLEMISHES."""
    def figure_of(rng: np.random.Generator, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        while True:
            contact = _middle(rng, shape)
            whole = contact.depth(x, y) >= 0
            figure = BLEMISHES[kind](rng, contact, whole, x, y)
            overlap = np.count_nonzero(figure & whole) / np.count_nonzero(figure | whole)
            if KEPT <= overlap <= 1 - SPOILED and ndimage.label(figure)[1] == 1:
                return figure
    return figure_of


def _at_edge(rng: np.random.Generator, contact: Contact) -> tuple[np.ndarray, np.ndarray]:
    """Return a random point on the outline, uniform by length, and the outward direction there."""
    corners = contact.outline(128)
    edge = np.roll(corners, -1, axis=0) - corners
    length = np.hypot(*edge.T)
    k = rng.choice(len(corners), p=length / length.sum())
    return corners[k] + rng.random() * edge[k], np.array((edge[k, 1], -edge[k, 0])) / length[k]


def _bar(x: np.ndarray, y: np.ndarray, start: np.ndarray, along: np.ndarray, size: tuple[float, float]) -> np.ndarray:
    """Return True for points in a bar that begins at ``start``, points ``along`` and has ``size`` (length, width)."""
    u, v = x - start[0], y - start[1]
    length, width = size
    ahead, aside = u * along[0] + v * along[1], v * along[0] - u * along[1]
    return (ahead >= -0.02) & (ahead <= length) & (np.abs(aside) <= width / 2)


def _turned(direction: np.ndarray, angle: float) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array((direction[0] * cos - direction[1] * sin, direction[0] * sin + direction[1] * cos))


def bump(rng: np.random.Generator, contact: Contact, whole: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Add a round bump at a random point on the outline."""
    place, _ = _at_edge(rng, contact)
    return whole | (np.hypot(x - place[0], y - place[1]) <= rng.uniform(0.1, 0.24))


def wire(rng: np.random.Generator, contact: Contact, whole: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Add a straight wire that sticks out of the contact, 0.4 to 1.2 taxels wide on a contact of 100 taxels."""
    place, outward = _at_edge(rng, contact)
    taxel = np.sqrt(AREA) / 10
    size = rng.uniform(2, 9) * taxel, rng.uniform(0.4, 1.2) * taxel
    return whole | _bar(x, y, place, _turned(outward, rng.uniform(-1, 1)), size)


def rough(rng: np.random.Generator, contact: Contact, whole: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Roughen the outline over lengths of 0.5 to 2 taxels on a contact of 100 taxels."""
    waves = ndimage.gaussian_filter(rng.standard_normal(x.shape), rng.uniform(0.5, 2) * np.sqrt(AREA) / 10 * 128 / 2)
    rough = contact.depth(x, y) + rng.uniform(0.01, 0.06) * waves / waves.std() >= 0
    labels, _ = ndimage.label(rough)
    return ndimage.binary_fill_holes(labels == np.bincount(labels[rough]).argmax())


def notch(rng: np.random.Generator, contact: Contact, whole: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Cut a slot or a round bite into the outline."""
    place, outward = _at_edge(rng, contact)
    if rng.random() < 0.5:
        return whole & (np.hypot(x - place[0], y - place[1]) > rng.uniform(0.1, 0.24))
    size = rng.uniform(0.1, 0.4), rng.uniform(0.05, 0.2)
    return whole & ~_bar(x, y, place + 0.05 * outward, _turned(-outward, rng.uniform(-0.6, 0.6)), size)


def chip(rng: np.random.Generator, contact: Contact, whole: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Cut off a corner along a straight line, or cut a flat into a circle."""
    corners = contact.outline(128)
    corner = corners[rng.integers(len(corners))]
    away = _turned(corner / np.hypot(*corner), rng.uniform(-0.3, 0.3))
    inward = rng.uniform(0.03, 0.3)
    return whole & (away[0] * x + away[1] * y <= away @ corner - inward)


BLEMISHES: dict[str, Blemish] = {
    'bump': bump, 'wire': wire, 'rough edge': rough, 'notch': notch, 'chipped corner': chip}
