"""What the pads of a simulated gripper are touched by: one object between them."""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from tactile_node.simulator.device import TaxelSource
from tactile_node.simulator.touches import AREAS, TouchProgram, touch_program
from tactile_node.skin.pads import PadSettings
from tactile_node.synthetic.figures import Silhouette
from tactile_node.synthetic.world import CLASSES

HOLD = 3.0  #: s for which a contact is held: long enough for a grasp to become stable
NOISE = 0.005  #: standard deviation of a taxel [fraction of full scale]
SLIDE_WAY = 2.0  #: pitches that a contact slides to either side
REST = 3.0  #: standard deviations by which a taxel at rest is above the lowest value, which would cut its noise off


def gripper_sources(pads: Sequence[PadSettings], shapes: Sequence[str | Silhouette] = CLASSES,
                    seed: int = 0, areas: tuple[float, ...] = AREAS, *, hold: float = HOLD, slide: float = 0.0,
                    noise: float = NOISE) -> dict[str, TaxelSource]:
    """One source a pad, by its name; every second pad sees the touch from behind.

    ``areas`` [taxels], ``hold`` [s] and ``slide`` [m/s] of each touch; ``noise`` of each taxel, as NOISE.
    """
    return {pad.name: _felt(pad, touch_program(pad.layout, shapes, areas, seed, hold), -1 if i % 2 else 1, slide, noise,
                            np.random.default_rng((seed, i))) for i, pad in enumerate(pads)}


def _felt(pad: PadSettings, program: TouchProgram, step: int, slide: float, noise: float,
          rng: np.random.Generator) -> TaxelSource:
    """Return what the taxels read, with columns in the sense of ``step``; on/off taxels have no noise."""
    value, is_on_off = pad.layout.value, pad.layout.value.bits == 1
    lowest, full_scale = sorted(value.to_value(np.array(value.raw_range)).tolist())
    deviation = 0.0 if is_on_off else noise * full_scale
    rest = max(0.0, lowest + REST * deviation) if deviation else 0.0

    def source(time: float) -> np.ndarray:
        values = program(time)[:, ::step]
        if slide:
            way = slide * time / pad.layout.pitch + SLIDE_WAY
            place = SLIDE_WAY - abs(way % (4 * SLIDE_WAY) - 2 * SLIDE_WAY)
            values = ndimage.shift(values, (place, 0), order=0 if is_on_off else 1)
        return values + rng.normal(rest, deviation, values.shape) if deviation else values
    return source
