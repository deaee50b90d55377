"""What the pads of a simulated gripper are touched by: one object between them."""

from collections.abc import Sequence

import numpy as np

from tactile_node.simulator.device import TaxelSource
from tactile_node.simulator.touches import AREAS, TouchProgram, full_scale, touch_program
from tactile_node.skin.pads import PadSettings
from tactile_node.synthetic.figures import Silhouette
from tactile_node.synthetic.world import CLASSES

HOLD = 3.0  #: s for which a contact is held: long enough for a grasp to become stable
NOISE = 0.005  #: standard deviation of a taxel [fraction of full scale]
REST = 3.0  #: standard deviations by which a taxel at rest is above the lowest value, which would cut its noise off


def gripper_sources(pads: Sequence[PadSettings], shapes: Sequence[str | Silhouette] = CLASSES,
                    seed: int = 0, areas: tuple[float, ...] = AREAS, *, hold: float = HOLD, slide: float = 0.0,
                    noise: float = NOISE) -> dict[str, TaxelSource]:
    """One source a pad, by its name; every second pad sees the touch from behind.

    ``areas`` [taxels], ``hold`` [s] and ``slide`` [m/s] of each touch; ``noise``: of each taxel with pressures, as
    NOISE.
    """
    programs = [touch_program(pad.layout, shapes, areas, seed, hold, slide=slide) for pad in pads]
    return {pad.name: _noisy(_mirrored(program) if i % 2 else program, pad, noise, np.random.default_rng((seed, i)))
            for i, (pad, program) in enumerate(zip(pads, programs))}


def _mirrored(program: TouchProgram) -> TaxelSource:
    return lambda t: program(t)[:, ::-1]


def _noisy(source: TaxelSource, pad: PadSettings, noise: float, rng: np.random.Generator) -> TaxelSource:
    if pad.layout.value.bits == 1 or not noise:
        return source
    size, deviation = (pad.layout.rows, pad.layout.cols), noise * full_scale(pad.layout)
    lowest = float(pad.layout.value.to_value(np.array(pad.layout.value.raw_range)).min())
    rest = max(0.0, lowest + REST * deviation)
    return lambda t: source(t) + rng.normal(rest, deviation, size)
