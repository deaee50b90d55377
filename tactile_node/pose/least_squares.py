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


WIDEST = 32   #: blocks across a contact at most [taxels of a fit]
AROUND = 3    #: blocks around the contact
VISIBLE = 0.5  #: of a block's taxels: with fewer valid ones it has no value


class Blocks(NamedTuple):
    """A frame and its contact in blocks."""

    values: np.ndarray  #: float, (rows, cols), NaN where too little of a block is seen
    mask: np.ndarray    #: bool
    x: float            #: column of the middle of block (0, 0) [taxels]
    y: float            #: row of it


def size_of(mask: np.ndarray) -> int:
    """Return the side of the blocks that a fit of the contact ``mask``, bool (rows, cols), takes: 1 for most.

    >>> size_of(np.ones((8, 8), bool)), size_of(np.ones((64, 10), bool))
    (1, 2)
    """
    extents = [np.ptp(np.flatnonzero(mask.any(axis))) + 1 for axis in (0, 1)]
    return int(-(-max(extents) // WIDEST))


def in_blocks(values: np.ndarray, mask: np.ndarray, size: int) -> Blocks:
    """Return what surrounds the contact as means of ``size`` x ``size`` taxels; those that the pad's edge cuts are NaN.
    """
    corner, counts = [], []
    for length, axis in zip(mask.shape, (1, 0)):
        used = np.flatnonzero(mask.any(axis))
        first = max(int(used[0]) - AROUND * size, 0)
        last = min(int(used[-1]) + 1 + AROUND * size, length)
        corner.append(first)
        counts.append(-(-(last - first) // size))
    (row, col), (rows, cols) = corner, counts
    window = np.full((rows * size, cols * size), np.nan)
    taxels = np.zeros(window.shape, bool)
    inside = slice(row, row + rows * size), slice(col, col + cols * size)
    part = values[inside]
    window[:part.shape[0], :part.shape[1]] = part
    taxels[:part.shape[0], :part.shape[1]] = mask[inside]
    valid = np.isfinite(window)
    shape, axes = (rows, size, cols, size), (1, 3)
    seen = valid.reshape(shape).sum(axes)
    whole = np.zeros((rows, cols), bool)
    whole[:part.shape[0] // size, :part.shape[1] // size] = True
    means = np.where(valid, window, 0).reshape(shape).sum(axes) / np.maximum(seen, 1)
    means[~whole | (seen < VISIBLE * size ** 2)] = np.nan
    half = (size - 1) / 2
    return Blocks(means, taxels.reshape(shape).mean(axes) >= 0.5, x=col + half, y=row + half)
