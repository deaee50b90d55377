"""Draw patterns, and compute the features of the paper's planes in several processes."""

from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from bench.reproduction.matrices import features_at_angles
from bench.reproduction.worlds import draw_pattern
from tactile_node.helmholtz.features import Group
from tactile_node.shape.volf import ANSWERS
from training.curve_fitting import COLUMNS, Samples
from training.ground_truth.seeds import Purpose, generator

BATCH = 250  #: number of patterns that a process draws at a time


class Wanted(NamedTuple):
    """Patterns to draw, with log-uniform areas between the two values of ``areas`` [taxels], which may be equal."""

    world: str
    purpose: Purpose
    patterns: int
    areas: tuple[float, float]


class Task(NamedTuple):
    """A batch for one process: ``patterns`` of the ``wanted`` patterns, starting at number ``first``."""

    wanted: Wanted
    first: int
    patterns: int
    rng: np.random.Generator


class Drawn(NamedTuple):
    """Features that the paper's planes use.

    ``every`` covers all 46 rotation angles. ``kept`` covers only the angles at which the rotated pattern still has at
    least half of its taxels.
    """

    every: Samples
    kept: Samples


def draw(wanted: dict[str, Wanted], seed: int, jobs: int) -> dict[str, Drawn]:
    """Draw the ``wanted`` patterns of each name. The result does not depend on ``jobs``."""
    parts: list[tuple[Wanted, int, int]] = []
    names: list[str] = []
    for name, each in wanted.items():
        for first in range(0, each.patterns, BATCH):
            names.append(name)
            parts.append((each, first, min(BATCH, each.patterns - first)))
    streams = {purpose: generator(purpose, seed).spawn(len(parts)) for purpose in Purpose}
    tasks = [Task(*part, streams[part[0].purpose][i]) for i, part in enumerate(parts)]
    rows: dict[str, list[np.ndarray]] = {name: [] for name in wanted}
    with ProcessPoolExecutor(jobs) if jobs > 1 else nullcontext() as pool:
        batches = tqdm(map(draw_batch, tasks) if pool is None else pool.map(draw_batch, tasks), 'drawing patterns',
                       len(tasks), disable=None)  # disable=None shows the bar only on a terminal
        for batch, name in zip(batches, names):
            rows[name].append(batch)
    return {name: _samples(np.concatenate(batches)) for name, batches in rows.items()}


def draw_batch(task: Task) -> np.ndarray:
    """Return (n, 13) rows: the features over all angles and over the kept angles, and the label.

    The shapes take turns.
    """
    wanted, first, count, rng = task
    low, high = np.log(wanted.areas)
    rows: list[list[float]] = []
    while len(rows) < count:
        shape = ANSWERS[(first + len(rows)) % len(ANSWERS)]
        mask = draw_pattern(wanted.world, rng, shape.value, float(np.exp(rng.uniform(low, high))))
        row = [*plane_features(mask), ANSWERS.index(shape)]
        if not np.isnan(row).any():  # alpha9 is undefined if no two taxels are neighbours
            rows.append(row)
    return np.array(rows)


def plane_features(mask: np.ndarray) -> list[float]:
    """Return the features in COLUMNS over all angles, then over the angles that keep at least half of the taxels."""
    at = features_at_angles(mask, Group.INFORMATION5 | Group.GRAVITY9)
    count = int(mask.sum())
    found = []
    for angles in (slice(None), at['N'] >= count / 2):
        for kind, name in COLUMNS:
            values = at[name][angles]
            values = values[~np.isnan(values)]
            least, most = (values.min(), values.max()) if len(values) else (np.nan, np.nan)
            found.append({'value': count, 'min': least, 'max': most, 'dif': most - least}[kind])
    return found


def _samples(rows: np.ndarray) -> Drawn:
    half = len(COLUMNS)
    labels = rows[:, -1].astype(int)
    return Drawn(*(Samples(dict(zip(COLUMNS, rows[:, first:first + half].T)), labels)
                   for first in (0, half)))
