"""A programme of touches: which shape presses a simulated pad when, as taxel values over time."""

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np

from tactile_node.skin.layout import SkinLayout
from tactile_node.synthetic.pressure import Skin, pressure_frame
from tactile_node.synthetic.world import CLASSES, Contact, random_contact

RAMP = 0.1  # s of pressing and of letting go
MEAN_PRESSURE = 0.6  # of full scale


@dataclass(frozen=True)
class Touch:
    """``contact`` presses from ``begin`` to ``end`` [s]; ``values``, shape (rows, cols), at full pressure."""

    contact: Contact
    begin: float
    end: float
    values: np.ndarray

    def load(self, t: float) -> float:
        """How much of the full pressure acts at ``t``: 0..1, with ramps at both ends."""
        return float(np.clip(min(t - self.begin, self.end - t) / RAMP, 0, 1))


class TouchProgram:
    """A sequence of touches, repeated for ever; calling it with a time [s] gives the taxels' values."""

    def __init__(self, touches: list[Touch], duration: float):
        self.touches, self.duration = tuple(touches), duration
        self._begins = [touch.begin for touch in touches]

    def __call__(self, t: float) -> np.ndarray:
        touch = self.touches[max(0, bisect_right(self._begins, t % self.duration) - 1)]
        load = touch.load(t % self.duration)
        # An on/off taxel has no part of a value: it is on while the load is more than half.
        return touch.values * (load if touch.values.dtype != bool else load > 0.5)

    def touch_at(self, t: float) -> Touch | None:
        """The touch that presses with its full pressure at ``t``, None between touches."""
        touch = self.touches[max(0, bisect_right(self._begins, t % self.duration) - 1)]
        return touch if touch.load(t % self.duration) == 1 else None


def touch_program(layout: SkinLayout, shapes: tuple[str, ...] = CLASSES,
                  areas: tuple[float, ...] = (40, 60, 80),
                  seed: int = 0, hold: float = 1.0, pause: float = 0.5) -> TouchProgram:
    """Every shape in every area [taxels], in general position, held ``hold``, parted by ``pause`` [s]."""
    rng, touches, now = np.random.default_rng(seed), [], pause
    for area in areas:
        for shape in shapes:
            contact = random_contact(rng, shape, area, layout.rows, layout.cols)
            touches.append(Touch(contact, now, now + hold, _values(layout, contact, rng)))
            now += hold + pause
    return TouchProgram(touches, now)


def _values(layout: SkinLayout, contact: Contact, rng: np.random.Generator) -> np.ndarray:
    """The contact as ``layout`` would measure it: a pattern for on/off taxels, else values in its unit."""
    if layout.value.bits == 1:
        return contact.pattern(layout.rows, layout.cols)
    full = abs(float(layout.value.to_value(np.array(layout.value.saturated_count))))
    return pressure_frame(contact, rng, layout.rows, layout.cols, pressure=MEAN_PRESSURE,
                          skin=Skin(full_scale=full))
