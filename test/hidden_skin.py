"""A simulated 16x16 skin: contact mechanics under a layer, readings that saturate, and a log of CAN frames.

The log uses the identifiers of CiA 301, and is written without the package's codec.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tactile_node.simulator.world import Contact
from training.ground_truth.indenters import flat_punch
from training.ground_truth.layer import sample, stress_field
from training.ground_truth.mechanics import Solution, solve

SIDE, PITCH, NODE_ID = 16, 0.002, 32
DEPTH = 0.7          #: Depth of the taxels below the surface [pitches].
FULL_SCALE = 255     #: [counts]
PERIOD = 0.02        #: [s]
IDLE = 12            #: Number of frames without a contact before and after each press.
ZERO = 6.0           #: Reading at rest [counts].


def solved(shape: str, lengths: Sequence[float], rounding: float) -> tuple[Solution, float]:
    """Return the contact solution for a pressed flat face, and the area of the face [taxels].

    ``lengths`` are in metres. ``rounding`` is the radius of the rounded edge, as a fraction of the inscribed radius.
    """
    contact = Contact(shape, tuple(length / PITCH for length in lengths), 0.0, 0.0)
    unit = Contact(shape, tuple(length / np.sqrt(contact.area) for length in contact.dimensions), 0.0, 0.0)
    return solve(flat_punch(unit, 0.03, rounding), cells=64), contact.area


def counts(pressure: np.ndarray) -> np.ndarray:
    """Return the readings of the skin, which are 1.25 p / (p + 0.25) of full scale for the relative pressure p."""
    pressure = np.maximum(pressure, 0)
    return FULL_SCALE * 1.25 * pressure / (pressure + 0.25)


def pressed(rng: np.random.Generator, solution: Solution, area: float, presses: int, frames: int) -> list[np.ndarray]:
    """Return the frames of ``presses`` presses at random poses, as uint8 counts.

    The pressure rises during the ``frames`` frames of each press. Between two presses, the skin carries no load.
    """
    field, found = stress_field(solution, area, DEPTH), [_noisy(rng, np.zeros((SIDE, SIDE))) for _ in range(IDLE)]
    for _ in range(presses):
        x, y = (SIDE - 1) / 2 + rng.uniform(-1, 1, 2)
        stress = sample(field, x, y, rng.uniform(0, 2 * np.pi), SIDE, SIDE)
        found += [_noisy(rng, counts(level * stress)) for level in np.linspace(0.1, 0.6, frames)]
        found += [_noisy(rng, np.zeros((SIDE, SIDE))) for _ in range(IDLE)]
    return found


def write_log(path: Path, frames: Sequence[np.ndarray]) -> None:
    """Write a log in candump format: for each frame a SYNC, followed by 32 TPDOs of 8 taxels, row by row."""
    lines, spacing = [], PERIOD / 40
    for number, frame in enumerate(frames):
        start = 1000.0 + number * PERIOD
        lines.append(f'({start:.6f}) can0 080#')
        for tpdo, eight in enumerate(frame.reshape(-1, 8)):
            can_id = 0x180 + 0x100 * (tpdo // 8) + tpdo % 8 + NODE_ID
            lines.append(f'({start + (tpdo + 1) * spacing:.6f}) can0 {can_id:03X}#{eight.tobytes().hex().upper()}')
    path.write_text('\n'.join(lines) + '\n')


def _noisy(rng: np.random.Generator, values: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(values + ZERO + rng.normal(0, 0.8, values.shape)), 0, FULL_SCALE).astype(np.uint8)
