"""Computed flat punches next to each other on one pad.

Each punch is computed alone, and the stresses are added. The sum of the stresses neglects that one punch raises the
skin under another.
"""

from typing import NamedTuple

import numpy as np

from bench.recognition import mechanics
from tactile_node.simulator.world import CLASSES
from training.ground_truth.layer import measured, sample, stress_field

WEAKEST = 0.5   #: Lowest pressure of a punch, as a share of the strongest punch's pressure.
ROOM = 5.0      #: Margin around the punches [pitches].
STEP = 0.25     #: Step by which a punch is moved away from the others [pitches].


class Pad(NamedTuple):
    """One pad with all its punches, and the same pad with each punch alone."""

    together: np.ndarray  #: frame (rows, cols) [fraction of full scale] with NaN for dead taxels
    alone: np.ndarray     #: (K, rows, cols)
    under: np.ndarray     #: (K, rows, cols), True for taxels well inside each punch
    labels: list[str]


def draw(rng: np.random.Generator, number: int, area: float, gap: float) -> Pad:
    """Draw a pad. Each punch is moved away from the earlier punches until a distance of ``gap`` separates them."""
    classes = rng.integers(len(CLASSES), size=number)
    solutions = [mechanics.solved(*mechanics.random_punch(rng, int(k)), rng.uniform(0, 2 * np.pi)) for k in classes]
    angles, outlines = rng.uniform(0, 2 * np.pi, number), []
    origins = []
    for solution, angle in zip(solutions, angles):
        outline, origin = _dense(mechanics.turned(solution.outline, angle) * np.sqrt(area)), np.zeros(2)
        towards = rng.uniform(0, 2 * np.pi)
        while outlines and _distance(outline + origin, np.concatenate(outlines)) < gap:
            origin = origin + STEP * np.array((np.cos(towards), np.sin(towards)))
        outlines.append(outline + origin)
        origins.append(origin)
    points = np.concatenate(outlines)
    cols, rows = np.ceil(np.ptp(points, 0) + 2 * ROOM).astype(int)
    places = np.array(origins) - points.min(0) + ROOM + rng.uniform(-0.5, 0.5, 2)
    depth, pressures = rng.uniform(*mechanics.DEPTH), rng.uniform(WEAKEST, 1, number) * rng.uniform(*mechanics.PRESSURE)
    stresses = np.array([sample(stress_field(solution, area, depth), x, y, angle, rows, cols)
                         for solution, angle, (x, y) in zip(solutions, angles, places)])
    pressed = stresses * pressures[:, np.newaxis, np.newaxis]
    frames = [measured(one, 1.0, rng, noise=mechanics.NOISE, dead=mechanics.DEAD) for one in (pressed.sum(0), *pressed)]
    return Pad(frames[0], np.array(frames[1:]), stresses >= 0.6, [solution.label for solution in solutions])


def _dense(corners: np.ndarray) -> np.ndarray:
    """Return points on the edges of a polygon, with 40 points per edge, or 2 if the polygon has more than 8 edges."""
    share = np.linspace(0, 1, 40 if len(corners) < 9 else 2, endpoint=False)[:, np.newaxis, np.newaxis]
    return (corners * (1 - share) + np.roll(corners, -1, 0) * share).reshape(-1, 2)


def _distance(points: np.ndarray, others: np.ndarray) -> float:
    return float(np.hypot(*(points[:, np.newaxis] - others).transpose(2, 0, 1)).min())
