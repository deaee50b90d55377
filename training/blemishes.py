"""Draw known shapes with a blemish: a bump, a notch, a rough edge, a wire, or a lost or rounded corner.

Each shape is a bool array on a grid, like the figures in families.py. A small blemish leaves the label of the shape
unchanged. A large blemish makes the shape foreign. The overlap with the five shapes decides which case applies
(forms.py).
"""

import numpy as np
from scipy import ndimage

from tactile_node.simulator.world import CLASSES, Contact, random_contact
from training.shapes import Figure, disc, inside, stroke

AREA = 1.6  #: Area of the shapes before a blemish is added.


def _shape(rng: np.random.Generator) -> Contact:
    return random_contact(rng, CLASSES[rng.integers(len(CLASSES))], AREA, rows=1, cols=1)


def _rim(rng, contact: Contact) -> tuple[np.ndarray, np.ndarray]:
    """Return a point on the outline, and the direction from the centre to this point."""
    outline = contact.outline()
    k, share = rng.integers(len(outline)), rng.random()
    point = (1 - share) * outline[k] + share * outline[(k + 1) % len(outline)]
    away = point - (contact.x, contact.y)
    return point, away / np.hypot(*away)


def _patch_at(rng, x, y, point: np.ndarray, size: float) -> np.ndarray:
    """Return a disc, a box or a triangle of about ``size`` at a point, with a random rotation."""
    angle = rng.uniform(0, 2 * np.pi)
    u, v = x - point[0], y - point[1]
    u, v = u * np.cos(angle) + v * np.sin(angle), v * np.cos(angle) - u * np.sin(angle)
    kind = rng.integers(3)
    if kind == 0:
        return np.hypot(u, v) <= size
    if kind == 1:
        return (np.abs(u) <= size) & (np.abs(v) <= size * rng.uniform(0.4, 1))
    return inside(u, v, 1.3 * size * np.array([(1, 0), (-0.5, 0.8), (-0.5, -0.8)]))


def bumped(rng, x, y):
    contact = _shape(rng)
    point, _ = _rim(rng, contact)
    return (contact.depth(x, y) >= 0) | _patch_at(rng, x, y, point, rng.uniform(0.08, 0.45))


def nicked(rng, x, y):
    contact = _shape(rng)
    point, _ = _rim(rng, contact)
    return (contact.depth(x, y) >= 0) & ~_patch_at(rng, x, y, point, rng.uniform(0.08, 0.45))


def rough(rng, x, y):
    """Return a shape whose outline is distorted by fine or coarse noise."""
    contact, cell = _shape(rng), x[0, 1] - x[0, 0]
    noise = ndimage.gaussian_filter(rng.standard_normal(x.shape), rng.uniform(0.03, 0.15) / cell)
    return contact.depth(x, y) + rng.uniform(0.01, 0.16) * noise / noise.std() >= 0


def wired(rng, x, y):
    """Return a shape with a thin tail, straight or bent."""
    contact = _shape(rng)
    point, away = _rim(rng, contact)
    turn = rng.uniform(-0.9, 0.9, 2).cumsum()
    steps = rng.uniform(0.1, 0.5, 2)[:, None] * np.column_stack((away[0] * np.cos(turn) - away[1] * np.sin(turn),
                                                                 away[0] * np.sin(turn) + away[1] * np.cos(turn)))
    line = np.concatenate(([point - 0.2 * away, point], point + steps.cumsum(0)))
    return (contact.depth(x, y) >= 0) | stroke(x, y, line, rng.uniform(0.03, 0.2))


def cornerless(rng, x, y):
    """Return a shape with a corner or a piece of a circle cut off, or with all corners rounded."""
    contact = _shape(rng)
    depth = contact.depth(x, y)
    if rng.random() < 0.5:
        size = rng.uniform(0.05, 0.3) / (x[0, 1] - x[0, 0])
        return _opened(depth >= 0, size)
    outline = contact.outline()
    corner = outline[rng.integers(len(outline))] - (contact.x, contact.y)
    far = np.hypot(*corner)
    along = ((x - contact.x) * corner[0] + (y - contact.y) * corner[1]) / far
    return (depth >= 0) & (along <= far * rng.uniform(0.6, 0.97))


def spotted(rng, x, y):
    """Return a shape with several small bumps and notches."""
    contact = _shape(rng)
    found = contact.depth(x, y) >= 0
    for _ in range(rng.integers(2, 6)):
        point, _ = _rim(rng, contact)
        spot = _patch_at(rng, x, y, point, rng.uniform(0.05, 0.18))
        found = found | spot if rng.random() < 0.5 else found & ~spot
    return found


def holed(rng, x, y):
    contact = _shape(rng)
    hole = disc(x, y, rng.uniform(0.08, 0.3), *(np.array((contact.x, contact.y)) + rng.uniform(-0.4, 0.4, 2)))
    return (contact.depth(x, y) >= 0) & ~hole


def _opened(figure: np.ndarray, size: float) -> np.ndarray:
    """Return ``figure`` with its convex corners rounded.

    The result is the part of the figure that can be covered by discs of ``size`` cells inside the figure.
    """
    core = ndimage.distance_transform_edt(figure) > size
    return figure & (ndimage.distance_transform_edt(~core) <= size) if core.any() else figure


BLEMISHES: dict[str, Figure] = {figure.__name__: figure for figure in (
    bumped, nicked, rough, wired, cornerless, spotted, holed)}
