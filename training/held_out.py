"""Draw foreign figures for validation only.

The validation uses these figures to measure how well the recogniser rejects kinds of figures that the training does not
contain.
"""

import numpy as np

from training.shapes import Figure, box, disc, inside, stroke


def heart(rng, x, y):
    wide, deep = rng.uniform(0.38, 0.5), rng.uniform(0.8, 1.2)
    lobes = disc(x, y, wide, -wide * 0.9, 0.2) | disc(x, y, wide, wide * 0.9, 0.2)
    return lobes | inside(x, y, np.array([(-1.8 * wide, 0.05), (0, 0.3), (1.8 * wide, 0.05), (0, -deep)]))


def keyhole(rng, x, y):
    foot = rng.uniform(0.2, 0.5)
    return disc(x, y, rng.uniform(0.4, 0.6), 0, 0.4) | inside(x, y, np.array([(-0.1, 0.4), (0.1, 0.4), (foot, -1),
                                                                            (-foot, -1)]))


def bolt(rng, x, y):
    """Return a zigzag of constant height."""
    by, wide = rng.uniform(0.2, 0.6), rng.uniform(0.25, 0.6)
    left = np.array([(0, -1), (by, -0.3), (-by / 2, 0.3), (by / 3, 1)])
    return inside(x, y, np.concatenate((left - (wide, 0), (left + (wide, 0))[::-1])) * 0.9)


def spoon(rng, x, y):
    bowl = ((x - 0.5) / rng.uniform(0.45, 0.6)) ** 2 + (y / rng.uniform(0.3, 0.5)) ** 2 <= 1
    return bowl | box(x, y, -1.1, 0.3, -0.1, rng.uniform(0.05, 0.15))


def house(rng, x, y):
    """Return a box with an off-centre roof."""
    top = rng.uniform(-0.5, 0.5)
    roof = np.array([(-1.1, 0.1), (1.1, 0.1), (top, rng.uniform(0.7, 1.2))])
    return box(x, y, -0.6, 0.6, -0.9, 0.2) | inside(x, y, roof)


def spiral(rng, x, y):
    turn = np.linspace(0, rng.uniform(1.2, 2.2) * 2 * np.pi, 40)
    radius = 0.1 + 0.85 * turn / turn[-1]
    return stroke(x, y, np.column_stack((radius * np.cos(turn), radius * np.sin(turn))), rng.uniform(0.2, 0.3))


HELD_OUT: dict[str, Figure] = {figure.__name__: figure for figure in (heart, keyhole, bolt, spoon, house, spiral)}
