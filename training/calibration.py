"""Convert logits into calibrated probabilities. The calibration uses only validation contacts."""

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
from training.model import TorchModel
from training.real_arrays import draw_real
from training.samples import LABELS, SMALLEST, UNKNOWN, Samples, joined_samples, samples_from
from training.segmentation import as_shipped

#: Largest fraction of clean contacts of the five shapes that may be called unknown, by size [taxels].
LOSSES = {12: 0.005, 25: 0.003, 50: 0.0012, 100: 0.0006}
#: Smallest bias. Large clean contacts would allow a smaller bias, but the same contacts under field conditions need
#: this one.
LEAST_BIAS = 0.5
#: Range of areas [taxels], side of the pad [taxels], and number of batches. A batch has at most 250 contacts, to save
#: memory.
CLEAN = ((9, 60, 30, 80), (60, 130, 36, 40), (130, 500, 56, 16))
NEAR = 0.3  #: Contacts are evaluated together if the logarithms of their sizes differ by at most this much.

#: Number of solutions, frames and poses for contacts computed by contact mechanics.
SOLUTIONS, FRAMES, POSES = 150, 12_000, 3
MECHANICS_SEED, MECHANICS_AREAS = 910_000, (9.0, 250.0)
REAL, REAL_SEED = 6000, 920_000  #: Number of contacts on real arrays, and the seed with which they are drawn.

#: Pressure, noise and fraction of dead taxels in clean contacts computed by contact mechanics. Tilt and depth are drawn
#: as in training.
PRESSURE, NOISE, DEAD = (0.05, 0.8), 0.01, 0.03


class Validation(NamedTuple):
    """Logits, labels and sizes of clean contacts of the five classes, from one source."""

    known: np.ndarray
    labels: np.ndarray
    log_taxels: np.ndarray


def validation(model: TorchModel, on_off: bool, seed: int, folder: Path) -> list[Validation]:
    """Return the validation contacts from each source.

    The sources are our generator and, for pressures, also contact mechanics and real arrays.

    Contact mechanics is not used for on/off taxels, because the thresholds at which real on/off taxels switch are
    unknown. The solved indenters are stored in ``folder``.
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
    """Draw contacts from contact mechanics, with the pressures, the noise and the share of dead taxels that are common
    in a gripper. The areas are log-uniform."""
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


def logits(model: TorchModel, samples: Samples) -> np.ndarray:
    with torch.no_grad():
        parts = [model(*map(torch.as_tensor, samples.inputs(part))).numpy()
                 for part in np.array_split(np.arange(len(samples.labels)), len(samples.labels) // 1000 + 1)]
    return np.concatenate(parts).astype(float)


def calibrated(worlds: list[Validation]) -> Calibration:
    """Return the temperature with the smallest log-loss, and the biases with which the losses stay within LOSSES.

    The biases are fitted to the first two sources: our generator and contact mechanics.

    The temperature is fitted to the hardest source, which is the last one. For pressures, the last source is the real
    arrays.
    """
    hardest = worlds[-1]

    def log_loss(log_temperature: float) -> float:
        scaled = hardest.known[:, :UNKNOWN] / np.exp(log_temperature)
        chosen = scaled[np.arange(len(scaled)), hardest.labels]
        return float((np.logaddexp.reduce(scaled, 1) - chosen).mean())
    temperature = float(np.exp(minimize_scalar(log_loss, bounds=(-1, 2), method='bounded').x))
    return Calibration(temperature, np.maximum(np.max([_biases(world) for world in worlds[:2]], axis=0), LEAST_BIAS))


def _biases(world: Validation) -> np.ndarray:
    """Return the largest permitted evidence for UNKNOWN, for each of LOG_SIZES.

    The fraction of contacts above this evidence is the fraction that LOSSES allows.
    """
    allowed = np.exp(np.interp(LOG_SIZES, np.log(list(LOSSES)), np.log(list(LOSSES.values()))))
    near = [np.abs(world.log_taxels - size) < NEAR for size in LOG_SIZES]
    return np.array([np.quantile(world.known[alike, UNKNOWN], 1 - loss) if alike.any() else -np.inf
                     for alike, loss in zip(near, allowed)])
