"""From logits to probabilities that mean something, on validation patterns alone."""

from typing import NamedTuple

import numpy as np
import torch
from scipy.optimize import minimize_scalar

from tactile_node.shape.recogniser import Calibration
from tactile_node.synthetic.seeds import Purpose, generator
from training.batch import draw_many
from training.model import Model
from training.samples import UNKNOWN, Samples, draw

LOSS = 0.001  #: of nominal contacts of more than ENOUGH taxels, the fraction that may be called unknown
ENOUGH = 12


class Validation(NamedTuple):
    """Logits and labels of nominal contacts of the five classes, and of outliers."""

    known: np.ndarray
    labels: np.ndarray
    taxels: np.ndarray
    outliers: np.ndarray


def validation(model: Model, on_off: bool, seed: int, nominal: int = 20_000, outliers: int = 1500) -> Validation:
    rng = generator(Purpose.VALIDATION, seed)
    drawn = [draw_many(rng, 250, on_off, (9, 75), faulty=0.05) for _ in range(nominal // 250)]
    known = Samples(*map(np.concatenate, zip(*drawn)))
    foreign = draw(rng, outliers, on_off, faulty=0.0, outliers=1.0)
    return Validation(logits(model, known), known.labels, np.exp(known.geometry[:, 0]), logits(model, foreign))


def logits(model: Model, samples: Samples) -> np.ndarray:
    with torch.no_grad():
        parts = [model(*map(torch.as_tensor, samples.inputs(part))).numpy()
                 for part in np.array_split(np.arange(len(samples.labels)), len(samples.labels) // 1000 + 1)]
    return np.concatenate(parts).astype(float)


def calibrated(found: Validation) -> Calibration:
    """The temperature of least log-loss; the bias at which LOSS of known contacts is called unknown."""
    def log_loss(log_temperature: float) -> float:  # noqa: E306
        scaled = found.known[:, :UNKNOWN] / np.exp(log_temperature)
        chosen = scaled[np.arange(len(scaled)), found.labels]
        return float((np.logaddexp.reduce(scaled, 1) - chosen).mean())
    temperature = float(np.exp(minimize_scalar(log_loss, bounds=(-1, 2), method='bounded').x))
    enough = found.taxels > ENOUGH
    bias = max(float(np.quantile(found.known[enough, UNKNOWN], 1 - LOSS)), 0.0)
    return Calibration(temperature, 1.0, bias)
