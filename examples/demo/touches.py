"""Script of the demo's touches, with the shape, pad and time of each touch and the resulting taxel values."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tactile_node.errors import ConfigurationError
from tactile_node.simulator.figures import Skin, pressure_frame
from tactile_node.simulator.touches import SimulatedTouch
from tactile_node.simulator.world import CLASSES, Contact, random_contact
from tactile_node.skin.pads import LivePad, make_pad

PADS = 'left', 'right'
NODE_IDS = 32, 64
LAYOUT = 'sim16x16.yaml'
LARGEST = 60.0  #: largest area with which every shape fits on 16 x 16 taxels [taxels]
TOUCH = 0.8     #: duration of a touch [s]
GAP = 0.3       #: time between two touches [s]
PRESSURE = 0.6  #: [fraction of full scale]
SKIN = Skin(noise=0.01)
MARGIN = 0.5  #: smallest distance between a contact and the pad's edge [pitches]


def demo_pads() -> list[LivePad]:
    return [make_pad(name, node_id, LAYOUT) for name, node_id in zip(PADS, NODE_IDS)]


def scripts_of(seed: int, areas: Sequence[float]) -> dict[str, tuple[SimulatedTouch, ...]]:
    """Return different touches for each pad, by pad name."""
    return {pad.name: scripted_touches(seed + number, areas, pad.layout.rows, pad.layout.cols)
            for number, pad in enumerate(demo_pads())}


def scripted_touches(seed: int, areas: Sequence[float], rows: int, cols: int) -> tuple[SimulatedTouch, ...]:
    """Return touches by each shape with each area, in random order and at random places and angles.

    The function raises ConfigurationError if a shape of one of the areas may not fit on the pad.
    """
    if not all(0 < area <= LARGEST for area in areas):
        raise ConfigurationError('--areas', expected=f'areas > 0 and up to {LARGEST:.0f} taxels', got=str(areas),
                                 remedy='Give smaller areas that fit on the pad, for example --areas 25 40 60.')
    rng = np.random.default_rng(seed)
    kinds = [(shape, area) for area in areas for shape in CLASSES]
    rng.shuffle(kinds)
    begins = GAP + (TOUCH + GAP) * np.arange(len(kinds))
    return tuple(SimulatedTouch(_fitting(rng, shape, float(area), rows=rows, cols=cols), float(begin),
                                float(begin) + TOUCH)
                 for (shape, area), begin in zip(kinds, begins))


class TouchedPad:
    """A TaxelSource for the simulated skin, which returns the values that a pad measures during ``touches``."""

    def __init__(self, touches: tuple[SimulatedTouch, ...], rows: int, cols: int, seed: int):
        self._touches = touches
        self._shape = rows, cols
        self._rng = np.random.default_rng(seed)

    def __call__(self, time: float) -> np.ndarray:
        """Return taxel values [Pa], shape (rows, cols)."""
        touch = next((touch for touch in self._touches if touch.begin <= time <= touch.end), None)
        if touch is None:
            return pressure_frame(None, self._rng, *self._shape, skin=SKIN)
        return pressure_frame(touch.contact, self._rng, *self._shape, pressure=PRESSURE * touch.load(time), skin=SKIN)


def _fitting(rng: np.random.Generator, shape: str, area: float, rows: int, cols: int) -> Contact:
    """Draw contacts until one fits on the pad, and place this contact anywhere on the pad."""
    while True:
        contact = random_contact(rng, shape, area, rows=rows, cols=cols)
        low, high = contact.outline().min(0), contact.outline().max(0)
        room = np.array((cols - 1, rows - 1)) - 2 * MARGIN - (high - low)
        if (room >= 0).all():
            dx, dy = MARGIN + rng.uniform(0, 1, 2) * room - low
            return replace(contact, x=contact.x + float(dx), y=contact.y + float(dy))
