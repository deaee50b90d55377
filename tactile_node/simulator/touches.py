"""A programme of touches: which shape presses a simulated pad when, as taxel values over time."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from tactile_node.skin.layout import SkinLayout
from tactile_node.synthetic.figures import Figure, Silhouette, random_figure
from tactile_node.synthetic.pressure import Skin, Touching, pressure_frame
from tactile_node.synthetic.world import CLASSES, Contact, random_contact

RAMP = 0.1  # s of pressing and of letting go
MEAN_PRESSURE = 0.6  # of full scale
AREAS = (40.0, 60.0, 80.0)  # taxels


Pressed = TypeVar('Pressed', bound=Touching)


@dataclass(frozen=True)
class Touch(Generic[Pressed]):
    """One object pressed on one pad from ``begin`` to ``end`` [s since the skin became operational]."""

    contact: Pressed
    begin: float
    end: float

    def load(self, time: float) -> float:
        """How much of the full pressure acts at ``time``: 0..1, with ramps at both ends."""
        return float(np.clip(min(time - self.begin, self.end - time) / RAMP, 0, 1))

    def is_steady(self, time: float) -> bool:
        """Whether the full pressure acts."""
        return self.begin + RAMP <= time <= self.end - RAMP


class TouchProgram:
    """A sequence of touches, repeated for ever; calling it with a time [s] gives the taxels' values.

    ``values[i]``: the taxels at the full pressure of ``touches[i]``, shape (rows, cols).
    """

    def __init__(self, touches: Sequence[Touch], values: Sequence[np.ndarray], duration: float):
        self.touches = tuple(touches)
        self.duration = duration
        self._values = tuple(values)
        self._begins = [touch.begin for touch in touches]

    def __call__(self, time: float) -> np.ndarray:
        time %= self.duration
        number = max(0, bisect_right(self._begins, time) - 1)
        load, values = self.touches[number].load(time), self._values[number]
        # An on/off taxel has no part of a value: it is on while the load is more than half.
        return values * (load if values.dtype != bool else load > 0.5)


def touch_program(layout: SkinLayout, shapes: Sequence[str | Silhouette] = CLASSES,
                  areas: tuple[float, ...] = AREAS,
                  seed: int = 0, hold: float = 1.0, pause: float = 0.5) -> TouchProgram:
    """Every shape in every area [taxels], in general position, held ``hold``, parted by ``pause`` [s]."""
    rng, now = np.random.default_rng(seed), pause
    touches, values = [], []
    for area in areas:
        for shape in shapes:
            contact = _contact(rng, shape, area, layout)
            touches.append(Touch(contact, now, now + hold))
            values.append(_values(layout, contact, rng))
            now += hold + pause
    return TouchProgram(touches, values, now)


def _contact(rng: np.random.Generator, shape: str | Silhouette, area: float, layout: SkinLayout) -> Contact | Figure:
    if isinstance(shape, Silhouette):
        return random_figure(rng, shape, area, rows=layout.rows, cols=layout.cols)
    return random_contact(rng, shape, area, rows=layout.rows, cols=layout.cols)


def _values(layout: SkinLayout, contact: Contact | Figure, rng: np.random.Generator) -> np.ndarray:
    """The contact as ``layout`` would measure it: a pattern for on/off taxels, else values in its unit."""
    if layout.value.bits == 1:
        return contact.pattern(layout.rows, layout.cols)
    full = abs(float(layout.value.to_value(np.array(layout.value.saturated_count))))
    return pressure_frame(contact, rng, layout.rows, layout.cols, pressure=MEAN_PRESSURE,
                          skin=Skin(full_scale=full))
