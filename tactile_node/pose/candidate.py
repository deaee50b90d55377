"""One start of a fit and what became of it: coarse, then with weights by its residuals, then fine."""

from typing import NamedTuple

import numpy as np

from tactile_node.geometry.outlines import Outline, outline_of
from tactile_node.pose.evidence import Evidence
from tactile_node.pose.first_guess import Guess
from tactile_node.pose.layer import Layer, expected_log_depth
from tactile_node.pose.least_squares import Problem, Solution, evaluate, minimise
from tactile_node.pose.model_error import Loading, area_and_radius
from tactile_node.pose.profiles import PUNCH, Profile
from tactile_node.pose.skin_model import Model, PatternModel, PressureModel
from tactile_node.shape.recognition import Shape

COARSE = 0.3         #: when the first pass stops [pitches]
FINE = 0.05          #: and the second
CLEARLY = 0.25       #: a less likely start is taken where its cost is lower by this factor
FIRST_NOISE = 0.05   #: of a value in the first pass [fraction of level]


class Candidate(NamedTuple):
    """A problem and how far its solution is."""

    problem: Problem
    solution: Solution
    handedness: int


def coarse(evidence: Evidence, shape: Shape, guess: Guess, profile: Profile = PUNCH,
           layer: Layer | None = None) -> Candidate:
    """Fit from ``guess`` with equal weights, until steps are short compared with a taxel; ``layer`` in pitches."""
    outline = outline_of(shape, guess.handedness)
    if evidence.on_off:
        model: Model = PatternModel(outline, evidence.window)
    else:
        model = PressureModel(outline, evidence.window, guess.parameters[:2], profile)
    expected = np.concatenate((guess.parameters, model.expected))
    precision = np.concatenate((_vague(outline, guess.parameters), model.precision))
    if isinstance(model, PressureModel) and layer is not None:
        _, radius = area_and_radius(outline.corners(model.starts(guess.parameters)[0][:len(guess.parameters)]))
        depth = expected_log_depth(layer, profile, radius)
        expected[-1], precision[-1] = depth.mean, depth.deviation ** -2
    problem = Problem(model, values=evidence.values, weights=evidence.used / FIRST_NOISE**2, expected=expected,
                      precision=precision)
    likely, *others = (evaluate(problem, start, model.predict(start)) for start in model.starts(guess.parameters))
    at = min((other for other in others if other.cost < CLEARLY * likely.cost), key=lambda start: start.cost,
             default=likely)
    return Candidate(problem, minimise(problem, at, tolerance=COARSE, max_steps=10), guess.handedness)


def _vague(outline: Outline, guess: np.ndarray) -> np.ndarray:
    """1 / variance of a guess: a length may be wrong by 100 %, the place by the largest; the angle is free."""
    _, _, dimensions = outline.split(guess)
    lengths = np.concatenate(([dimensions.max()] * 2, *([[1.8]] if outline.symmetry else []), dimensions))
    return 1 / np.maximum(lengths, 1)**2


def with_likely_peak(candidate: Candidate) -> Candidate:
    """Set the prior of the peak to the nearest known kind of object, if the fit is certain enough."""
    problem, model, solution = candidate.problem, candidate.problem.model, candidate.solution
    if not isinstance(model, PressureModel):
        return candidate
    deviation = np.sqrt(np.linalg.inv(solution.information)[model.PEAK, model.PEAK])
    likely = model.likely_peak(solution.parameters, deviation)
    if likely is None:
        return candidate
    expected, precision = problem.expected.copy(), problem.precision.copy()
    expected[model.PEAK], precision[model.PEAK] = likely
    problem = problem._replace(expected=expected, precision=precision)
    return candidate._replace(problem=problem, solution=evaluate(problem, solution.parameters, solution.prediction))


def reweighted(candidate: Candidate, weights: np.ndarray) -> Candidate:
    """Return the same point with other ``weights`` of the taxels, (taxels,)."""
    problem, solution = candidate.problem._replace(weights=weights), candidate.solution
    solution = evaluate(problem, solution.parameters, solution.prediction)
    return candidate._replace(problem=problem, solution=solution)


def fine(candidate: Candidate) -> Candidate:
    """Go on to the end."""
    solution = minimise(candidate.problem, candidate.solution, tolerance=FINE, max_steps=6)
    return candidate._replace(solution=solution)


def loading_of(found: Candidate) -> Loading | None:
    """Return how the object loads the skin, lengths in pitches; None where the taxels are on/off."""
    model = found.problem.model
    if not isinstance(model, PressureModel):
        return None
    *_, peak, log_depth = found.solution.parameters
    return Loading(model.profile.indenter, float(peak), float(np.exp(log_depth)))
