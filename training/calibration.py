"""From logits to probabilities that mean something, on validation contacts alone."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from scipy.optimize import minimize_scalar

from tactile_node.shape.recogniser import LOG_SIZES, Calibration
from tactile_node.synthetic.seeds import Purpose, generator
from training.batch import draw_many
from training.mechanics import draw_mechanics, solution_pool
from training.model import Model
from training.samples import SMALLEST, UNKNOWN, Samples, joined_samples, samples_from
from training.segmentation import as_shipped

#: of clean contacts of the five shapes, the fraction that may be called unknown, by size [taxels]
LOSSES = {12: 0.005, 25: 0.0025, 50: 0.001, 100: 0.0005}
LEAST_BIAS = 1.5  #: large clean contacts would allow less, but the same contacts in the field need it
CLEAN = ((9, 60, 30, 80), (60, 130, 36, 40), (130, 500, 56, 16))  #: areas, pad, batches of 250 or what memory holds
SOLUTIONS, FRAMES = 150, 4000  #: of contact mechanics
MECHANICS_SEED = 910_000


class Validation(NamedTuple):
    """Logits, labels and sizes of clean contacts of the five classes, of each world in turn."""

    known: np.ndarray
    labels: np.ndarray
    log_taxels: np.ndarray


def validation(model: Model, on_off: bool, seed: int, folder: Path) -> list[Validation]:
    """Of our generator and of contact mechanics; ``folder`` keeps the solved indenters."""
    rng = generator(Purpose.VALIDATION, seed)
    own = joined_samples([draw_many(rng, min(250, 400_000 // pad ** 2), on_off, (low, high), faulty=0.0, pad=pad)
                          for low, high, pad, batches in CLEAN for _ in range(batches)])
    return [Validation(logits(model, known), known.labels, known.geometry[:, 0])
            for known in (own, mechanics_samples(rng, on_off, FRAMES, folder))]


def mechanics_samples(rng: np.random.Generator, on_off: bool, count: int, folder: Path,
                      areas: tuple[float, float] = (9.0, 200.0)) -> Samples:
    solutions = solution_pool(folder, SOLUTIONS, MECHANICS_SEED, Purpose.VALIDATION)
    drawn = draw_mechanics(rng, count, on_off, solutions, areas)
    patterns = [as_shipped(frame, on_off) for frame in drawn.frames]
    return samples_from((pattern, pattern.mask, label) for pattern, label in zip(patterns, drawn.labels)
                        if pattern.mask.sum() >= SMALLEST)


def logits(model: Model, samples: Samples) -> np.ndarray:
    with torch.no_grad():
        parts = [model(*map(torch.as_tensor, samples.inputs(part))).numpy()
                 for part in np.array_split(np.arange(len(samples.labels)), len(samples.labels) // 1000 + 1)]
    return np.concatenate(parts).astype(float)


def calibrated(worlds: list[Validation]) -> Calibration:
    """The temperature of least log-loss; the bias by size at which no world loses more than LOSSES."""
    own = worlds[0]

    def log_loss(log_temperature: float) -> float:
        scaled = own.known[:, :UNKNOWN] / np.exp(log_temperature)
        chosen = scaled[np.arange(len(scaled)), own.labels]
        return float((np.logaddexp.reduce(scaled, 1) - chosen).mean())
    temperature = float(np.exp(minimize_scalar(log_loss, bounds=(-1, 2), method='bounded').x))
    return Calibration(temperature, np.maximum(np.max([_biases(world) for world in worlds], axis=0), LEAST_BIAS))


def _biases(world: Validation) -> np.ndarray:
    """What a contact's evidence for UNKNOWN exceeds as rarely as LOSSES allow, at each of SIZES."""
    nearest = np.abs(world.log_taxels[:, None] - LOG_SIZES).argmin(1)
    allowed = np.exp(np.interp(LOG_SIZES, np.log(list(LOSSES)), np.log(list(LOSSES.values()))))
    evidence = [world.known[nearest == size, UNKNOWN] for size in range(len(LOG_SIZES))]
    return np.array([np.quantile(found, 1 - loss) if len(found) else -np.inf
                     for found, loss in zip(evidence, allowed)])
