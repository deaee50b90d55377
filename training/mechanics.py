"""Draw contacts computed by contact mechanics, for training.

A pool of solved indenters is sampled at many sizes and poses.

Lengths are in taxel pitches, and pressures are fractions of full scale. The ranges and seeds in this module are for
training only. The reported figures use other ranges and seeds (bench/recognition/mechanics.py).
"""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactile_node.simulator.world import CLASSES, random_contact
from training.ground_truth.indenters import Indenter, ball, cone, cylinder, flat_punch
from training.ground_truth.layer import measured, sample, stress_field
from training.ground_truth.mechanics import Solution, solve
from training.ground_truth.seeds import Purpose, generator
from training.samples import LABELS
from training.solutions import read_solutions, source_digest, write_solutions

SOLUTIONS = 1000
SEED = 900_000      #: Seed of the pool. No other part of the training uses this seed.
POSES = 4           #: Number of successive frames with the same solution, size and depth.
LEAST_SIDE = 12     #: Smallest number of rows and columns in a pad.

#: Largest shift of the contact that a tilt may cause [square root of the contact's area]. A larger shift means that too
#: much of the contact has lifted off.
MOST_SHIFT = 0.10

COMPRESSION = (0.005, 0.15)  #: Range of mean pressure divided by contact modulus.
ROUNDING = (0.0, 0.3)        #: Radius of the edges of a punch [inscribed radius].
TILT = (0.0, 0.8)
DEPTH = (0.15, 1.3)          #: Depth of the taxels [pitches].
PRESSURE = (0.04, 0.9)       #: Mean pressure over the contact.

#: Pressure on an on/off skin. The threshold follows the pressure, so the pressure only determines the relative noise.
ON_OFF_PRESSURE = 0.5
NOISE = (0.0, 0.02)
DEAD = (0.0, 0.06)
APERTURE = (0.7, 1.0)        #: Side of a taxel's sensitive square [pitches].

#: Threshold of an on/off skin [mean pressure]. The middle of a flat punch carries about half of the mean pressure.
THRESHOLD = (0.15, 0.6)
RATIO = (1.5, 3.0)           #: Side ratio of a rectangle, and of the contact under a cylinder on its side.

#: Share of balls and of cones among circles, and of cylinders on their side among rectangles. All other indenters are
#: flat punches.
BALLS, CONES, CYLINDERS = 0.25, 0.2, 0.3


class Frames(NamedTuple):
    """K frames with their labels and conditions."""

    frames: list[np.ndarray]  #: (rows, cols) each, fractions of full scale, or 0 and 1; NaN for a dead taxel
    labels: np.ndarray        #: (K,), index into LABELS
    areas: np.ndarray         #: (K,), area of the contact [taxels]
    depths: np.ndarray        #: (K,), depth of the taxels [pitches]
    pressures: np.ndarray     #: (K,), mean pressure over the contact


def solution_pool(folder: Path, count: int = SOLUTIONS, seed: int = SEED, purpose: Purpose = Purpose.TRAINING,
                  ) -> list[Solution]:
    """Return ``count`` solutions of all classes in turn.

    The solutions are computed once and then read from ``folder``.
    """
    path = folder / f'{purpose.name.lower()}_{seed}_{count}_{source_digest()}.npz'
    if not path.exists():
        rng = generator(purpose, seed)
        write_solutions(path, [random_solution(rng, CLASSES[k % len(CLASSES)]) for k in range(count)])
    return read_solutions(path)


def draw_mechanics(rng: np.random.Generator, count: int, on_off: bool, solutions: list[Solution],
                   areas: tuple[float, float] = (8.0, 200.0), least_side: int = LEAST_SIDE) -> Frames:
    """Draw ``count`` frames. The contact areas [taxels] are log-uniform in the range ``areas``.

    POSES successive frames share a solution, size and depth, so the caller should shuffle the frames. An area refers to
    the cells in contact, not to the punch. Pads are square and leave a margin around the contact.
    """
    frames, facts = [], []
    while len(frames) < count:
        solution = solutions[rng.integers(len(solutions))]
        area, depth, aperture = _log_uniform(rng, areas), rng.uniform(*DEPTH), rng.uniform(*APERTURE)
        field = stress_field(solution, area, depth)
        side = max(least_side, int(np.ceil(3.2 * np.sqrt(area))) + 8)
        for _ in range(min(POSES, count - len(frames))):
            x, y = rng.uniform(-0.5, 0.5, 2) + (side - 1) / 2
            stress = sample(field, x, y, rng.uniform(0, 2 * np.pi), side, side, aperture)
            pressure = ON_OFF_PRESSURE if on_off else _log_uniform(rng, PRESSURE)
            frames.append(_read(rng, stress, pressure, on_off))
            facts.append((LABELS.index(solution.label), area, depth, pressure))
    labels, *others = (np.array(column) for column in zip(*facts))
    return Frames(frames, labels, *others)


def random_solution(rng: np.random.Generator, label: str) -> Solution:
    """Draw an indenter of one class and its tilt, and solve the contact."""
    while True:
        indenter = random_indenter(rng, label)
        solution = solve(indenter, _random_tilt(rng, indenter.kind))
        if contact_shift(solution) < MOST_SHIFT:
            return solution


def random_indenter(rng: np.random.Generator, label: str) -> Indenter:
    """Draw an indenter whose contact has the shape ``label``, one of world.CLASSES."""
    compression, kind = _log_uniform(rng, COMPRESSION), rng.random()
    if label == 'circle' and kind < BALLS:
        return ball(compression)
    if label == 'circle' and kind < BALLS + CONES:
        return cone(compression, tip=rng.uniform(0, 0.6))
    if label == 'rectangle' and kind < CYLINDERS:
        return cylinder(compression, rng.uniform(*RATIO), rounding=rng.uniform(0, 0.6))
    contact = replace(random_contact(rng, label, 1.0), x=0.0, y=0.0, angle=0.0)
    return flat_punch(contact, compression, rng.uniform(*ROUNDING))


def contact_shift(solution: Solution) -> float:
    """Return the distance from the centre of area of the indenter to that of the contact [square root of the area]."""
    rows, cols = np.nonzero(solution.contact)
    x, y = solution.origin
    return float(np.hypot(x + cols.mean() * solution.cell, y + rows.mean() * solution.cell))


def _random_tilt(rng: np.random.Generator, kind: str) -> tuple[float, float]:
    """Draw a tilt.

    Balls and cones are not tilted. A cylinder tilts only along its axis, because a tilt around the axis would make it
    roll.
    """
    tilt, angle = rng.uniform(*TILT), rng.uniform(0, 2 * np.pi)
    if kind == 'flat_punch':
        return float(tilt * np.cos(angle)), float(tilt * np.sin(angle))
    return (float(tilt), 0.0) if kind == 'cylinder' else (0.0, 0.0)


def _read(rng: np.random.Generator, stress: np.ndarray, pressure: float, on_off: bool) -> np.ndarray:
    values = measured(stress, pressure, rng, noise=rng.uniform(*NOISE), dead=rng.uniform(*DEAD))
    if not on_off:
        return values
    threshold = pressure * rng.uniform(*THRESHOLD)
    return np.where(np.isnan(values), np.nan, values >= threshold)


def _log_uniform(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    return float(np.exp(rng.uniform(*np.log(limits))))
