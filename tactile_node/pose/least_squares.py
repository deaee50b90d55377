"""Levenberg-Marquardt for a handful of parameters, with weights and a Gaussian prior on the model's extras."""

from typing import NamedTuple

import numpy as np

from tactile_node.pose.skin_model import Model, Prediction

MAX_STEP = 1.0  #: of any parameter in one step [pitches, radians, relative]
SMALLEST = 0.3  #: no dimension gets smaller [pitches]


class Solution(NamedTuple):
    """Where an iteration stopped."""

    parameters: np.ndarray
    prediction: Prediction
    information: np.ndarray  #: inverse of the covariance for weights that are 1 / variance
    cost: float              #: weighted sum of squares, prior included


def minimise(model: Model, parameters: np.ndarray, values: np.ndarray, weights: np.ndarray, *,
             tolerance: float = 1e-3, max_steps: int = 12) -> Solution:
    """Minimise sum weights (values - model)², starting at ``parameters``; stops below ``tolerance`` [pitches]."""
    damping = 1e-3
    best = _evaluate(model, parameters, values, weights)
    for _ in range(max_steps):
        step = _step(model, best, values, weights, damping)
        trial = _evaluate(model, _bounded(model, best.parameters + step), values, weights)
        size = np.abs(trial.parameters - best.parameters).max()
        if trial.cost <= best.cost:
            best, damping = trial, damping / 10
        else:
            damping *= 20
        if size < tolerance:
            break
    return best


def _evaluate(model: Model, parameters: np.ndarray, values: np.ndarray, weights: np.ndarray) -> Solution:
    prediction = model.predict(parameters)
    information = (prediction.jacobian * weights) @ prediction.jacobian.T
    residual = values - prediction.values
    cost = weights @ residual**2
    if model.precision.size:
        own = slice(-model.precision.size, None)
        information[own, own] += np.diag(model.precision)
        cost += model.precision @ (parameters[own] - model.start)**2
    return Solution(parameters, prediction, information, float(cost))


def _step(model: Model, at: Solution, values: np.ndarray, weights: np.ndarray, damping: float) -> np.ndarray:
    slope = at.prediction.jacobian @ (weights * (values - at.prediction.values))
    if model.precision.size:
        slope[-model.precision.size:] += model.precision * (model.start - at.parameters[-model.precision.size:])
    damped = at.information + np.diag(damping * np.diag(at.information) + 1e-9)
    step = np.linalg.solve(damped, slope)
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
