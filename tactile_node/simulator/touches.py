"""Sequences of touches on simulated pads or a simulated gripper, as taxel values over time."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tactile_node.simulator.device import TaxelSource
from tactile_node.simulator.figures import (
    NAMED,
    Figure,
    Skin,
    Touching,
    named_silhouette,
    pressure_frame,
    random_figure,
)
from tactile_node.simulator.world import CLASSES, Contact, random_contact
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.pads import PadSettings
from tactile_node.taxel_frame import PRESS_BY_UNIT

RAMP = 0.1  #: time in which the pressure rises or falls [s]
#: default areas of the contacts [taxels] on a pad with at least AREAS_SIDE rows and columns
TOUCH_AREAS = (40.0, 60.0, 80.0)
AREAS_SIDE = 16  #: shorter side for which TOUCH_AREAS are chosen [taxels]
LEAST_AREA = 12.0  #: smallest default area [taxels], because smaller squares are never recognised with high confidence


@dataclass(frozen=True)
class SimulatedTouch:
    """One object pressed onto one pad from ``begin`` to ``end`` [s after the skin became operational]."""

    contact: Touching
    begin: float
    end: float

    def load(self, time: float) -> float:
        """Return the pressure at ``time`` as a fraction of the full pressure, with ramps at both ends."""
        return float(np.clip(min(time - self.begin, self.end - time) / RAMP, 0, 1))

    def is_steady(self, time: float) -> bool:
        """Return True if the touch has full pressure at ``time``."""
        return self.begin + RAMP <= time <= self.end - RAMP


def touch_areas(layout: SkinLayout) -> tuple[float, ...]:
    """Return the default areas of the contacts [taxels]. On a small pad, larger contacts would be cut by its edges."""
    share = min(1.0, (min(layout.rows, layout.cols) / AREAS_SIDE) ** 2)
    return tuple(max(LEAST_AREA, share * area) for area in TOUCH_AREAS)


class TouchProgram:
    """A sequence of touches that repeats indefinitely. Calling the programme with a time [s] returns the taxel values.

    The programme presses each shape in each size, in general position.

    Parameters
    ----------
    layout
        Layout of the pad.
    shapes
        Names of the shapes that touch the pad, of CLASSES or NAMED.
    areas
        Areas of the contacts [taxels], or empty for those of `touch_areas`.
    seed
        Seed of the random positions, angles and ratios.
    hold
        Duration of each contact [s].
    pause
        Time between two contacts [s].
    rounds
        Number of touches for each shape and area.

    Attributes
    ----------
    touches
        Touches in chronological order.
    duration
        Time after which the sequence repeats [s].
    """

    def __init__(self, layout: SkinLayout, shapes: Sequence[str] = CLASSES, areas: tuple[float, ...] = (),
                 seed: int = 0, hold: float = 1.0, pause: float = 0.5, rounds: int = 1):
        rng, now = np.random.default_rng(seed), pause
        self.touches: list[SimulatedTouch] = []
        self._values: list[np.ndarray] = []  # taxel values of each touch at full pressure
        silhouettes = {shape: named_silhouette(shape) for shape in shapes if shape in NAMED}
        for area in (areas or touch_areas(layout)) * rounds:
            for shape in shapes:
                contact = (random_figure(rng, silhouettes[shape], area, layout.rows, layout.cols)
                           if shape in silhouettes else random_contact(rng, shape, area, layout.rows, layout.cols))
                self.touches.append(SimulatedTouch(contact, now, now + hold))
                self._values.append(_values(layout, contact, rng))
                now += hold + pause
        self.duration = now

    def __call__(self, time: float) -> np.ndarray:
        time %= self.duration
        number = max(0, bisect_right(self.touches, time, key=lambda touch: touch.begin) - 1)
        load, values = self.touches[number].load(time), self._values[number]
        # An on/off taxel has no intermediate values, so the taxel is on while the load is above one half.
        return values * (load if values.dtype != bool else load > 0.5)


def _values(layout: SkinLayout, contact: Contact | Figure, rng: np.random.Generator) -> np.ndarray:
    """Return the values that the pad would measure: an on/off pattern, or values in the layout's unit."""
    if layout.value.bits == 1:
        return contact.pattern(layout.rows, layout.cols)
    full = abs(float(layout.value.to_value(np.array(layout.value.saturated_count))))
    return pressure_frame(contact, rng, layout.rows, layout.cols, pressure=0.6,
                          skin=Skin(full_scale=full))


#: duration of a contact [s], long enough for a grasp to become stable
TOUCH_HOLD = 3.0
#: time between two contacts [s], long enough that one of several 1 s tares sees no contact
TOUCH_PAUSE = 2.5
#: standard deviation of a taxel [fraction of full scale], unless MOST_NOISE is lower
TAXEL_NOISE = 0.005
#: maximum default noise [fraction of the press threshold]; with more noise, an untouched pad would seem pressed
MOST_NOISE = 1 / 60


def gripper_sources(pads: Sequence[PadSettings], shapes: Sequence[str] = CLASSES,
                    seed: int = 0, areas: tuple[float, ...] = (), *, rounds: int = 1, hold: float = TOUCH_HOLD,
                    pause: float = TOUCH_PAUSE) -> dict[str, TaxelSource]:
    """Return sources of taxel values by pad name. Touches on every second pad are mirrored.

    Parameters
    ----------
    pads
        Pads of the gripper.
    seed
        Seed of the touches and the noise.
    shapes, areas, rounds, hold, pause
        As for `TouchProgram`.
    """
    programs = [TouchProgram(pad.layout, shapes, areas, seed, hold, pause, rounds) for pad in pads]
    return {pad.name: _felt(pad, program, -1 if i % 2 else 1, np.random.default_rng((seed, i)))
            for i, (pad, program) in enumerate(zip(pads, programs))}


def _felt(pad: PadSettings, program: TouchProgram, step: int, rng: np.random.Generator) -> TaxelSource:
    """Return a source with noise; a ``step`` of -1 mirrors the columns. On/off taxels get no noise."""
    value = pad.layout.value
    lowest, full_scale = sorted(value.to_value(np.array(value.raw_range)).tolist())
    deviation = 0.0 if value.bits == 1 else min(TAXEL_NOISE * full_scale, MOST_NOISE * PRESS_BY_UNIT[value.unit])
    rest = max(0.0, lowest + 3 * deviation) if deviation else 0.0  # noise around the lowest value would be clipped

    def source(time: float) -> np.ndarray:
        values = program(time)[:, ::step]
        return values + rng.normal(rest, deviation, values.shape) if deviation else values
    return source
