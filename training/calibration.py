"""From logits to probabilities that mean something, on validation contacts alone."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from scipy.optimize import minimize_scalar

from tactile_node.shape.patch import joined
from tactile_node.shape.recogniser import LOG_SIZES, Calibration
from training.batch import draw_many
from training.ground_truth.layer import measured, sample, stress_field
from training.ground_truth.mechanics import Solution
from training.ground_truth.seeds import Purpose, generator
from training.mechanics import DEPTH, solution_pool
from training.model import Model
from training.real_arrays import draw_real
from training.samples import LABELS, SMALLEST, UNKNOWN, Samples, joined_samples, samples_from
from training.segmentation import as_shipped

#: of clean contacts of the five shapes, the fraction that may be called unknown, by size [taxels]
LOSSES = {12: 0.005, 25: 0.003, 50: 0.0012, 100: 0.0006}
LEAST_BIAS = 0.5  #: large clean contacts would allow less, but the same contacts in the field need it
CLEAN = ((9, 60, 30, 80), (60, 130, 36, 40), (130, 500, 56, 16))  #: areas, pad, batches of 250 or what memory holds
NEAR = 0.3  #: contacts of sizes within this logarithm count alike
SOLUTIONS, FRAMES, POSES = 150, 12_000, 3  #: of contact mechanics
MECHANICS_SEED, MECHANICS_AREAS = 910_000, (9.0, 250.0)
REAL, REAL_SEED = 6000, 920_000  #: of real arrays
PRESSURE, NOISE, DEAD = (0.05, 0.8), 0.01, 0.03  #: of clean contacts by mechanics; tilt and depth as in training


class Validation(NamedTuple):
    """Logits, labels and sizes of clean contacts of the five classes, of each world in turn."""

    known: np.ndarray
    labels: np.ndarray
    log_taxels: np.ndarray


def validation(model: Model, on_off: bool, seed: int, folder: Path) -> list[Validation]:
    """Of our generator and, pressures, of contact mechanics and of real arrays; ``folder`` keeps the solved indenters.

    Where an on/off taxel of a contact by mechanics is on depends on thresholds that are not known.
    """
    rng = generator(Purpose.VALIDATION, seed)
    own = joined_samples([draw_many(rng, min(250, 400_000 // pad ** 2), on_off, (low, high), faulty=0.0, pad=pad)
                          for low, high, pad, batches in CLEAN for _ in range(batches)])
    worlds = [own] if on_off else [own, mechanics_samples(rng, folder),
                                   draw_real(generator(Purpose.VALIDATION, REAL_SEED), REAL, on_off)]
    return [Validation(logits(model, known), known.labels, known.geometry[:, 0]) for known in worlds]


def validation_solutions(folder: Path) -> list[Solution]:
    return solution_pool(folder, SOLUTIONS, MECHANICS_SEED, Purpose.VALIDATION)


def mechanics_samples(rng: np.random.Generator, folder: Path) -> Samples:
    """Clean contacts by mechanics, as they are pressed in most grips; the areas log-uniform."""
    solutions = validation_solutions(folder)
    found = []
    while len(found) < FRAMES:
        solution = solutions[rng.integers(len(solutions))]
        area = np.exp(rng.uniform(*np.log(MECHANICS_AREAS)))
        field, side = stress_field(solution, area, rng.uniform(*DEPTH)), int(np.ceil(3.2 * np.sqrt(area))) + 8
        for _ in range(POSES):
            x, y = rng.uniform(-0.5, 0.5, 2) + (side - 1) / 2
            pressure = rng.uniform(*PRESSURE)
            frame = measured(sample(field, x, y, rng.uniform(0, 2 * np.pi), side, side), pressure, rng, noise=NOISE,
                             dead=DEAD)
            pattern = as_shipped(frame, on_off=False)
            if pattern.mask.sum() >= SMALLEST:
                found.append((pattern, joined(pattern), LABELS.index(solution.label)))
    return samples_from(found)


def logits(model: Model, samples: Samples) -> np.ndarray:
    with torch.no_grad():
        parts = [model(*map(torch.as_tensor, samples.inputs(part))).numpy()
                 for part in np.array_split(np.arange(len(samples.labels)), len(samples.labels) // 1000 + 1)]
    return np.concatenate(parts).astype(float)


def calibrated(worlds: list[Validation]) -> Calibration:
    """The temperature of least log-loss; the bias by size at which no clean world loses more than LOSSES.

    The temperature is that of the hardest world, the last: real arrays, where there are pressures.
    """
    hardest = worlds[-1]

    def log_loss(log_temperature: float) -> float:
        scaled = hardest.known[:, :UNKNOWN] / np.exp(log_temperature)
        chosen = scaled[np.arange(len(scaled)), hardest.labels]
        return float((np.logaddexp.reduce(scaled, 1) - chosen).mean())
    temperature = float(np.exp(minimize_scalar(log_loss, bounds=(-1, 2), method='bounded').x))
    return Calibration(temperature, np.maximum(np.max([_biases(world) for world in worlds[:2]], axis=0), LEAST_BIAS))


def _biases(world: Validation) -> np.ndarray:
    """What a contact's evidence for UNKNOWN exceeds as rarely as LOSSES allow, at each of SIZES."""
    allowed = np.exp(np.interp(LOG_SIZES, np.log(list(LOSSES)), np.log(list(LOSSES.values()))))
    near = [np.abs(world.log_taxels - size) < NEAR for size in LOG_SIZES]
    return np.array([np.quantile(world.known[alike, UNKNOWN], 1 - loss) if alike.any() else -np.inf
                     for alike, loss in zip(near, allowed)])
