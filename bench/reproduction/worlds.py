"""Worlds from which patterns are drawn: the benchmark, and worlds that may explain the paper's higher rates."""

from typing import NamedTuple

import numpy as np

from tactile_node.simulator.world import PAD, Contact
from training.ground_truth.seeds import random_pattern


class Fixed(NamedTuple):
    """A world in which each class has only one aspect ratio, at random positions and angles."""

    rectangle: float = 2.0       #: ratio of the sides
    right_triangle: float = 2.0  #: ratio of the legs
    apex: float = 60.0           #: apex angle of the isosceles triangle [degrees]


ONE_PROPORTION = Fixed()
LONG_RECTANGLES = Fixed(rectangle=4.0)
#: Worlds by name. The value None is the benchmark, in which the aspect ratios vary.
WORLDS: dict[str, Fixed | None] = {
    'benchmark': None, 'one proportion': ONE_PROPORTION, 'long rectangles': LONG_RECTANGLES}


def draw_pattern(world: str, rng: np.random.Generator, shape: str, area: float) -> np.ndarray:
    """Draw the pattern of a contact from ``world`` at a random position and angle, as bool (rows, cols)."""
    fixed = WORLDS[world]
    if fixed is None:
        return random_pattern(rng, shape, area)
    room = max(PAD, int(np.ceil(6 * np.sqrt(area))) + 4)
    return draw_contact(fixed, rng, shape, area, room).pattern(room, room)


def draw_contact(fixed: Fixed, rng: np.random.Generator, shape: str, area: float, room: int) -> Contact:
    """Draw a contact of ``area`` [taxels] at a random angle near the middle of a pad with ``room`` rows and columns."""
    x, y = rng.uniform(-0.5, 0.5, 2) + (room - 1) / 2
    angle, handedness = rng.uniform(0, 2 * np.pi), rng.choice((-1.0, 1.0))
    return Contact(shape, _dimensions(fixed, shape, area, handedness), x=x, y=y, angle=angle)


def _dimensions(fixed: Fixed, shape: str, area: float, handedness: float) -> tuple[float, ...]:
    if shape == 'rectangle':
        return (np.sqrt(area * fixed.rectangle), np.sqrt(area / fixed.rectangle))
    if shape == 'right_triangle':
        return (np.sqrt(2 * area * fixed.right_triangle), np.sqrt(2 * area / fixed.right_triangle), handedness)
    if shape == 'isosceles_triangle':
        slope = 2 * np.tan(np.radians(fixed.apex) / 2)  # base / height
        return (np.sqrt(2 * area * slope), np.sqrt(2 * area / slope))
    return {'circle': (np.sqrt(area / np.pi),), 'square': (np.sqrt(area),)}[shape]
