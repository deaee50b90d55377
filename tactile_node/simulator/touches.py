"""A programme of touches: which shape presses a simulated pad when, as taxel values over time."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from tactile_node.skin.layout import SkinLayout
from tactile_node.synthetic.figures import Figure, Silhouette, random_figure
from tactile_node.synthetic.pressure import Skin, Touching, pressure_frame
from tactile_node.synthetic.world import CLASSES, Contact, random_contact

RAMP = 0.1  # s of pressing and of letting go
SLIDE_WAY = 2.0  # pitches to either side
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

    ``values[i]``: the taxels at the full pressure of ``touches[i]``, shape (rows, cols); of contacts that slide
    ``slid`` gives them.
    """

    def __init__(self, touches: Sequence[Touch], values: Sequence[np.ndarray], duration: float,
                 slid: Callable[[Touch, float], np.ndarray] | None = None):
        self.touches = tuple(touches)
        self.duration = duration
        self._values = tuple(values)
        self._slid = slid
        self._begins = [touch.begin for touch in touches]

    def __call__(self, time: float) -> np.ndarray:
        time %= self.duration
        number = max(0, bisect_right(self._begins, time) - 1)
        touch = self.touches[number]
        load = touch.load(time)
        values = self._slid(touch, time) if self._slid and load else self._values[number]
        # An on/off taxel has no part of a value: it is on while the load is more than half.
        return values * (load if values.dtype != bool else load > 0.5)


def touch_program(layout: SkinLayout, shapes: Sequence[str | Silhouette] = CLASSES,
                  areas: tuple[float, ...] = AREAS,
                  seed: int = 0, hold: float = 1.0, pause: float = 0.5, slide: float = 0.0) -> TouchProgram:
    """Every shape in every area [taxels], in general position, held ``hold``, parted by ``pause`` [s].

    While it is held, a contact slides at ``slide`` [m/s], to and fro.
    """
    rng, now = np.random.default_rng(seed), pause
    touches, values = [], []
    for area in areas:
        for shape in shapes:
            contact = _contact(rng, shape, area, layout)
            touches.append(Touch(contact, now, now + hold))
            values.append(_values(layout, contact, rng))
            now += hold + pause
    def slid(touch: Touch, time: float) -> np.ndarray:
        way = slide / layout.pitch * (time - touch.begin)
        return _values(layout, replace(touch.contact, y=touch.contact.y + _to_and_fro(way)), rng)
    return TouchProgram(touches, values, now, slid if slide else None)


def _to_and_fro(way: float) -> float:
    """Return the place after ``way`` from 0 to SLIDE_WAY, to -SLIDE_WAY and back [pitches]."""
    return SLIDE_WAY - abs((way + SLIDE_WAY) % (4 * SLIDE_WAY) - 2 * SLIDE_WAY)


def _contact(rng: np.random.Generator, shape: str | Silhouette, area: float, layout: SkinLayout) -> Contact | Figure:
    if isinstance(shape, Silhouette):
        return random_figure(rng, shape, area, rows=layout.rows, cols=layout.cols)
    return random_contact(rng, shape, area, rows=layout.rows, cols=layout.cols)


def _values(layout: SkinLayout, contact: Contact | Figure, rng: np.random.Generator) -> np.ndarray:
    """The contact as ``layout`` would measure it: a pattern for on/off taxels, else values in its unit."""
    if layout.value.bits == 1:
        return contact.pattern(layout.rows, layout.cols)
    return pressure_frame(contact, rng, layout.rows, layout.cols, pressure=MEAN_PRESSURE,
                          skin=Skin(full_scale=full_scale(layout)))


def full_scale(layout: SkinLayout) -> float:
    """Return the largest pressure or force of a taxel, in the layout's unit; not for on/off taxels."""
    return abs(float(layout.value.to_value(np.array(layout.value.saturated_count))))
