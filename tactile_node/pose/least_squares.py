"""Levenberg-Marquardt for a handful of parameters, with weights and a Gaussian prior on the model's extras."""

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv

from tactile_node.pose.skin_model import Model, Prediction

MAX_STEP = 1.0  #: of any parameter in one step [pitches, radians, relative]
SMALLEST = 0.3  #: no dimension gets smaller [pitches]


class Solution(NamedTuple):
    """Where an iteration stopped."""

    parameters: np.ndarray
    prediction: Prediction
    information: np.ndarray  #: inverse of the covariance for weights that are 1 / variance
    cost: float              #: weighted sum of squares, prior included


def minimise(model: Model, at: Solution, values: np.ndarray, weights: np.ndarray, *, tolerance: float,
             max_steps: int) -> Solution:
    """Minimise sum weights (values - model)² from ``at``; the last step is shorter than ``tolerance`` [pitches].

    Steps converge quadratically: what is left then is of the order of ``tolerance`` squared.
    """
    damping, best = 1e-3, at
    for _ in range(max_steps):
        step = _step(model, best, values, weights, damping)
        parameters = _bounded(model, best.parameters + step)
        trial = evaluate(model, parameters, model.predict(parameters), values, weights)
        size = np.abs(trial.parameters - best.parameters).max()
        if trial.cost <= best.cost:
            best, damping = trial, damping / 10
        else:
            damping *= 20
        if size < tolerance:
            break
    return best


def evaluate(model: Model, parameters: np.ndarray, prediction: Prediction, values: np.ndarray,
             weights: np.ndarray) -> Solution:
    """Return what ``weights`` make of ``prediction``, the model's at ``parameters``."""
    information = (prediction.jacobian * weights) @ prediction.jacobian.T
    residual = values - prediction.values
    cost = weights @ residual**2
    extras = model.precision.size
    if extras:
        information.reshape(-1)[::len(parameters) + 1][-extras:] += model.precision
        cost += model.precision @ (parameters[-extras:] - model.start)**2
    return Solution(parameters, prediction, information, float(cost))


def _step(model: Model, at: Solution, values: np.ndarray, weights: np.ndarray, damping: float) -> np.ndarray:
    slope = at.prediction.jacobian @ (weights * (values - at.prediction.values))
    extras = model.precision.size
    if extras:
        slope[-extras:] += model.precision * (model.start - at.parameters[-extras:])
    damped = at.information.copy()
    diagonal = damped.reshape(-1)[::len(slope) + 1]
    diagonal *= 1 + damping
    diagonal += 1e-9
    step = dposv(damped, slope)[1]
    return step * min(1.0, MAX_STEP / max(np.abs(step).max(), 1e-12))


def _bounded(model: Model, parameters: np.ndarray) -> np.ndarray:
    """Dimensions stay positive, blur stays between none and a pitch."""
    extras = model.precision.size
    first = len(parameters) - extras - len(model.outline.dimensions)
    dimensions = slice(first, len(parameters) - extras)
    parameters[dimensions] = np.maximum(parameters[dimensions], SMALLEST)
    if extras:
        parameters[-1] = min(max(parameters[-1], 0.0), 0.6)
    return parameters
