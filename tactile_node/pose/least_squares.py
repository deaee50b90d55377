"""Levenberg-Marquardt for a handful of parameters, with weights and a Gaussian prior."""

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv

from tactile_node.pose.skin_model import Model, Prediction

MAX_STEP = 1.0  #: of any parameter in one step [pitches, radians, relative]
SMALLEST = 0.3  #: no dimension gets smaller [pitches]


class Problem(NamedTuple):
    """What is minimised: sum weights (values - model)² + sum precision (parameters - expected)²."""

    model: Model
    values: np.ndarray     #: (taxels,)
    weights: np.ndarray    #: (taxels,), 1 / variance
    expected: np.ndarray   #: (parameters,), beforehand
    precision: np.ndarray  #: (parameters,), 1 / variance of that; > 0 lets even one taxel have an answer


class Solution(NamedTuple):
    """Where an iteration stopped."""

    parameters: np.ndarray
    prediction: Prediction
    information: np.ndarray  #: inverse of the covariance
    misfit: float            #: sum weights (values - model)²
    cost: float              #: that and the prior's part: what is minimised


def minimise(problem: Problem, at: Solution, *, tolerance: float, max_steps: int) -> Solution:
    """Minimise from ``at``; the last step of the outline is shorter than ``tolerance`` [pitches].

    Steps converge quadratically: what is left then is of the order of ``tolerance`` squared.
    """
    damping, best, geometry = 1e-3, at, len(problem.model.outline.parameters)
    for _ in range(max_steps):
        parameters = _bounded(problem.model, best.parameters + _step(problem, best, damping))
        trial = evaluate(problem, parameters, problem.model.predict(parameters))
        size = np.abs(trial.parameters - best.parameters)[:geometry].max()
        if trial.cost <= best.cost:
            best, damping = trial, damping / 10
        else:
            damping *= 20
        if size < tolerance:
            break
    return best


def evaluate(problem: Problem, parameters: np.ndarray, prediction: Prediction) -> Solution:
    """Return what the problem makes of ``prediction``, the model's at ``parameters``."""
    information = (prediction.jacobian * problem.weights) @ prediction.jacobian.T
    information.reshape(-1)[::len(parameters) + 1] += problem.precision
    misfit = problem.weights @ (problem.values - prediction.values)**2
    cost = misfit + problem.precision @ (parameters - problem.expected)**2
    return Solution(parameters, prediction, information, float(misfit), float(cost))


def _step(problem: Problem, at: Solution, damping: float) -> np.ndarray:
    slope = (at.prediction.jacobian @ (problem.weights * (problem.values - at.prediction.values))
             + problem.precision * (problem.expected - at.parameters))
    damped = at.information.copy()
    diagonal = damped.reshape(-1)[::len(slope) + 1]
    diagonal *= 1 + damping
    step: np.ndarray = dposv(damped, slope)[1]
    step *= min(1.0, MAX_STEP / max(np.abs(step).max(), 1e-12))
    return step


def _bounded(model: Model, parameters: np.ndarray) -> np.ndarray:
    """Dimensions stay positive, extras where the model knows them."""
    extras = model.expected.size
    first = len(parameters) - extras - len(model.outline.dimensions)
    dimensions = slice(first, len(parameters) - extras)
    parameters[dimensions] = np.maximum(parameters[dimensions], SMALLEST)
    if extras:
        parameters[-extras:] = model.bounded(parameters[-extras:])
    return parameters
