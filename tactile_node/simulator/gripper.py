"""What the pads of a simulated gripper are touched by: one object between them."""

from collections.abc import Sequence

from tactile_node.simulator.device import TaxelSource
from tactile_node.simulator.touches import AREAS, TouchProgram, touch_program
from tactile_node.skin.pads import PadSettings
from tactile_node.synthetic.figures import Silhouette
from tactile_node.synthetic.world import CLASSES


def gripper_sources(pads: Sequence[PadSettings], shapes: Sequence[str | Silhouette] = CLASSES,
                    seed: int = 0, areas: tuple[float, ...] = AREAS) -> dict[str, TaxelSource]:
    """One source a pad, by its name; every second pad sees the touch from behind. ``areas`` [taxels]."""
    programs = [touch_program(pad.layout, shapes, areas, seed=seed) for pad in pads]
    return {pad.name: _mirrored(program) if i % 2 else program
            for i, (pad, program) in enumerate(zip(pads, programs))}


def _mirrored(program: TouchProgram) -> TaxelSource:
    return lambda t: program(t)[:, ::-1]
