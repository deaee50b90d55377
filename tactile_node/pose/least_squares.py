"""Levenberg-Marquardt minimisation over a few parameters, with weights and a Gaussian prior."""

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv

from tactile_node.contact.neighbours import box_of
from tactile_node.pose.skin_model import Model, Prediction

LONGEST_STEP = 1.0     #: Largest change of a parameter in one step [pitches, radians or relative].
LEAST_DIMENSION = 0.3  #: Smallest value of a dimension [pitches].


class Problem(NamedTuple):
    """A least-squares problem: minimise sum weights (values - model)² + sum precision (parameters - expected)²."""

    model: Model
    values: np.ndarray     #: values to fit, (taxels,)
    weights: np.ndarray    #: 1 / variance of each value, (taxels,)
    expected: np.ndarray   #: mean of the prior, (parameters,)

    #: 1 / variance of the prior, (parameters,); values > 0 ensure a solution even for a single taxel
    precision: np.ndarray


class Solution(NamedTuple):
    """The state of the minimisation after one step."""

    parameters: np.ndarray
    prediction: Prediction
    information: np.ndarray  #: inverse covariance of the parameters
    misfit: float            #: sum weights (values - model)²
    cost: float              #: quantity that is minimised: the misfit plus the contribution of the prior


def minimise(problem: Problem, at: Solution, *, tolerance: float, max_steps: int) -> Solution:
    """Minimise from a starting point until one step changes the outline by less than ``tolerance``.

    The steps converge quadratically, so the remaining error is of the order of ``tolerance`` squared.

    Parameters
    ----------
    problem : Problem
        The sum to minimise.
    at : Solution
        Start.
    tolerance : float
        Change of the outline below which the iteration stops [pitches].
    max_steps : int
        Largest number of steps.
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
    """Return the solution at ``parameters``, for which the model predicts ``prediction``."""
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
    step *= min(1.0, LONGEST_STEP / max(np.abs(step).max(), 1e-12))
    return step


def _bounded(model: Model, parameters: np.ndarray) -> np.ndarray:
    """Return the parameters with positive dimensions, and with the extras limited to the model's range."""
    extras = len(model.outline.parameters)
    dimensions = slice(extras - len(model.outline.dimensions), extras)
    parameters[dimensions] = np.maximum(parameters[dimensions], LEAST_DIMENSION)
    model.bound(parameters[extras:])
    return parameters


class Place(NamedTuple):
    """A point at which a model was computed, and near which the model is treated as linear."""

    parameters: np.ndarray
    prediction: Prediction

    def shown_at(self, parameters: np.ndarray) -> Prediction:
        """Return the prediction at nearby ``parameters``."""
        values = self.prediction.values + (parameters - self.parameters) @ self.prediction.jacobian
        return self.prediction._replace(values=values)


NEAR_OUTLINE = 0.05  #: Largest change of the outline for which a linear model is accurate [pitches, radians].
NEAR_EXTRAS = 0.1    #: Largest change of the model's extras for which a linear model is accurate.


def is_near(model: Model, parameters: np.ndarray, place: np.ndarray) -> bool:
    """Return True if the model, linearised at ``place``, is accurate at ``parameters``."""
    away, outline = np.abs(parameters - place), len(model.outline.parameters)
    return bool(away[:outline].max() < NEAR_OUTLINE and away[outline:].max(initial=0.0) < NEAR_EXTRAS)


def solved(problem: Problem, at: Place) -> Solution:
    """Return the minimum of ``problem`` with its model linearised at ``at``."""
    step = _step(problem, evaluate(problem, at.parameters, at.prediction), damping=0.0)
    parameters = _bounded(problem.model, at.parameters + step)
    return evaluate(problem, parameters, at.shown_at(parameters))


MOST_BLOCKS = 32   #: Largest number of blocks across a contact.
BLOCKS_AROUND = 3  #: Number of additional blocks to fit on each side of the contact.
LEAST_SEEN = 0.5   #: Smallest share of valid taxels for which a block has a value.


class Blocks(NamedTuple):
    """A frame and its contact mask, reduced to blocks of taxels."""

    values: np.ndarray  #: mean of each block, (rows, cols), or NaN if too few of its taxels are valid
    mask: np.ndarray    #: bool
    x: float            #: column at the centre of block (0, 0) [taxels]
    y: float            #: row at the centre of block (0, 0) [taxels]


def size_of(mask: np.ndarray) -> int:
    """Return the side length of the blocks for fitting the contact ``mask`` [taxels]; it is 1 for most contacts.

    >>> size_of(np.ones((8, 8), bool)), size_of(np.ones((64, 10), bool))
    (1, 2)
    """
    rows, cols = box_of(mask)
    return int(-(-max(rows.stop - rows.start, cols.stop - cols.start) // MOST_BLOCKS))


def in_blocks(values: np.ndarray, mask: np.ndarray, size: int) -> Blocks:
    """Return the contact and its surroundings as means of ``size`` x ``size`` taxels.

    Blocks cut off by the pad's edge are NaN.
    """
    part, missing, corner = [], [], []
    for used, length in zip(box_of(mask), mask.shape):
        first, last = max(used.start - BLOCKS_AROUND * size, 0), min(used.stop + BLOCKS_AROUND * size, length)
        stop = first - (first - last) // size * size
        part.append(slice(first, stop))
        missing.append((0, max(stop - length, 0)))
        corner.append(first + (size - 1) / 2)

    def blocks(taxels: np.ndarray, beyond: float) -> np.ndarray:
        padded = np.pad(taxels[tuple(part)], missing, constant_values=beyond)
        return padded.reshape(padded.shape[0] // size, size, -1, size)
    window, is_cut = blocks(values, np.nan), blocks(np.zeros(mask.shape, bool), True).any((1, 3))
    valid = np.isfinite(window)
    seen = valid.sum((1, 3))
    means = np.where(valid, window, 0).sum((1, 3)) / np.maximum(seen, 1)
    means[is_cut | (seen < LEAST_SEEN * size ** 2)] = np.nan
    return Blocks(means, blocks(mask, False).mean((1, 3)) >= 0.5, x=corner[1], y=corner[0])
