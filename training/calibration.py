"""From logits to probabilities that mean something, on validation patterns alone."""

from typing import NamedTuple

import numpy as np
import torch
from scipy.optimize import minimize_scalar

from tactile_node.shape.recogniser import LOG_SIZES, Calibration
from tactile_node.synthetic.seeds import Purpose, generator
from training.batch import draw_many
from training.model import Model
from training.samples import UNKNOWN, Samples

LOSS = 0.001  #: of nominal contacts of any size, the fraction that may be called unknown
LEAST_BIAS = 1.5  #: large nominal contacts would allow less, but the same contacts in the field need it


class Validation(NamedTuple):
    """Logits, labels and sizes of nominal contacts of the five classes."""

    known: np.ndarray
    labels: np.ndarray
    log_taxels: np.ndarray


def validation(model: Model, on_off: bool, seed: int, patterns: int = 30_000) -> Validation:
    rng = generator(Purpose.VALIDATION, seed)
    drawn = [draw_many(rng, 250, on_off, (9, 85), faulty=0.0) for _ in range(patterns // 250)]
    known = Samples(*map(np.concatenate, zip(*drawn)))
    return Validation(logits(model, known), known.labels, known.geometry[:, 0])


def logits(model: Model, samples: Samples) -> np.ndarray:
    with torch.no_grad():
        parts = [model(*map(torch.as_tensor, samples.inputs(part))).numpy()
                 for part in np.array_split(np.arange(len(samples.labels)), len(samples.labels) // 1000 + 1)]
    return np.concatenate(parts).astype(float)


def calibrated(found: Validation) -> Calibration:
    """The temperature of least log-loss; the bias by size at which LOSS of known contacts is unknown."""
    def log_loss(log_temperature: float) -> float:  # noqa: E306
        scaled = found.known[:, :UNKNOWN] / np.exp(log_temperature)
        chosen = scaled[np.arange(len(scaled)), found.labels]
        return float((np.logaddexp.reduce(scaled, 1) - chosen).mean())
    temperature = float(np.exp(minimize_scalar(log_loss, bounds=(-1, 2), method='bounded').x))
    nearest = np.abs(found.log_taxels[:, None] - LOG_SIZES).argmin(1)
    biases = [np.quantile(found.known[nearest == size, UNKNOWN], 1 - LOSS) for size in range(len(LOG_SIZES))]
    return Calibration(temperature, np.maximum(biases, LEAST_BIAS))
