"""Fit an outline from one starting point: a coarse pass, new weights from the residuals, then a fine pass."""

from typing import NamedTuple

import numpy as np

from tactile_node.pose.evidence import Evidence
from tactile_node.pose.first_guess import Guess
from tactile_node.pose.least_squares import Problem, Solution, evaluate, minimise
from tactile_node.pose.model_error import Loading, area_and_radius
from tactile_node.pose.outlines import Outline, outline_of
from tactile_node.pose.profiles import DOMES, PUNCH, Layer, Profile, expected_log_depth
from tactile_node.pose.skin_model import Model, PressureModel
from tactile_node.shape.recognition import Shape

COARSE_TOLERANCE = 0.3  #: The first pass stops at a step shorter than this [pitches].
FINE_TOLERANCE = 0.05   #: The second pass stops at a step shorter than this [pitches].

#: A less likely starting point is chosen if its cost is below this share of the likeliest starting point's cost.
CLEAR_RATIO = 0.25
FIRST_NOISE = 0.05      #: Noise that the first pass assumes for each taxel value [fraction of level].


class Candidate(NamedTuple):
    """A least-squares problem and the solution reached so far."""

    problem: Problem
    solution: Solution
    handedness: int


def coarse(evidence: Evidence, shape: Shape, guess: Guess, profile: Profile = PUNCH,
           layer: Layer | None = None) -> Candidate:
    """Run the first pass of a fit with equal weights, until the steps are short compared with a taxel.

    Parameters
    ----------
    evidence : Evidence
        Taxels to which the outline is fitted.
    shape : Shape
        Shape of the outline.
    guess : Guess
        Starting point of the fit.
    profile : Profile
        Pressure profile of the object; ignored for on/off taxels.
    layer : Layer or None
        Layer of a calibrated skin, with lengths in pitches, or None if the layer is unknown.
    """
    outline = outline_of(shape, guess.handedness)
    if evidence.on_off:
        model = Model(outline, evidence.window)
    else:
        model = PressureModel(outline, evidence.window, guess.parameters[:2], profile)
    expected = np.concatenate((guess.parameters, model.expected))
    precision = np.concatenate((_vague(outline, guess.parameters), model.precision))
    if isinstance(model, PressureModel) and layer is not None:
        _, radius = area_and_radius(outline.corners(model.starts(guess.parameters)[0][:len(guess.parameters)]))
        expected[-1], deviation = expected_log_depth(layer, profile, radius)
        precision[-1] = deviation ** -2
    problem = Problem(model, values=evidence.values, weights=evidence.used / FIRST_NOISE**2, expected=expected,
                      precision=precision)
    likely, *others = (evaluate(problem, start, model.predict(start)) for start in model.starts(guess.parameters))
    at = min((other for other in others if other.cost < CLEAR_RATIO * likely.cost), key=lambda start: start.cost,
             default=likely)
    return Candidate(problem, minimise(problem, at, tolerance=COARSE_TOLERANCE, max_steps=10), guess.handedness)


def _vague(outline: Outline, guess: np.ndarray) -> np.ndarray:
    """Return 1 / variance of each parameter of a guess.

    The standard deviation of a length is the length itself. The standard deviation of the position is the largest
    length. The angle is almost unconstrained.
    """
    _, _, dimensions = outline.split(guess)
    lengths = np.concatenate(([dimensions.max()] * 2, *([[1.8]] if outline.symmetry else []), dimensions))
    return 1 / np.maximum(lengths, 1)**2


def with_likely_peak(candidate: Candidate) -> Candidate:
    """Return the candidate with the peak's prior taken from the kind of object that its fit resembles.

    If the fit is too uncertain, the candidate is returned unchanged.
    """
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
    """Return the candidate at the same parameters, with new ``weights``, (taxels,)."""
    problem, solution = candidate.problem._replace(weights=weights), candidate.solution
    solution = evaluate(problem, solution.parameters, solution.prediction)
    return candidate._replace(problem=problem, solution=solution)


def fine(candidate: Candidate) -> Candidate:
    """Return the candidate after the fine pass."""
    solution = minimise(candidate.problem, candidate.solution, tolerance=FINE_TOLERANCE, max_steps=6)
    return candidate._replace(solution=solution)


def loading_of(found: Candidate) -> Loading | None:
    """Return how the object loads the skin, with lengths in pitches, or None for on/off taxels."""
    model = found.problem.model
    if not isinstance(model, PressureModel):
        return None
    *_, peak, log_depth = found.solution.parameters
    return Loading(model.profile.indenter, float(peak), float(np.exp(log_depth)))


# These thresholds were chosen on the training seeds so that few punches and few even pressures are mistaken for domes.
CIRCLE_PEAK = 0.3        #: A circular contact with a higher fitted peak is not a dome.
BALL_PEAK = -0.05        #: A circular contact with a lower fitted peak may be a ball.
DOME_CURVATURE = -0.005  #: Residuals with a lower curvature may come from a dome.

# A dome can look like an even pressure on deep taxels. The contact may be a dome if both of these limits are exceeded.
BAD_MISFIT = 2.0  #: weighted sum of squared residuals per taxel
DEEP_LAYER = 0.5  #: depth of the taxels [pitches]

#: A circular contact with a lower fitted peak is not a punch. No punch, sharp or rounded, presses this much harder at
#: its centre.
NO_PUNCH_PEAK = -0.3


def may_be_dome(evidence: Evidence, shape: Shape, punch: Candidate) -> bool:
    """Return True if a contact fitted as a punch may be a ball, a cone or a cylinder on its side.

    Under a dome, the residuals fall from the centre of the contact outwards. Under a ball, the fitted peak can also be
    negative.

    Parameters
    ----------
    evidence : Evidence
        Taxels to which the outline was fitted.
    shape : Shape
        Shape of the outline.
    punch : Candidate
        Candidate fitted as a punch.
    """
    loading = loading_of(punch)
    if loading is None or shape not in DOMES or shape is Shape.CIRCLE and loading.peak > CIRCLE_PEAK:
        return False
    if shape is Shape.CIRCLE and (
            loading.peak < BALL_PEAK
            or loading.depth > DEEP_LAYER and punch.solution.misfit > BAD_MISFIT * np.count_nonzero(evidence.used)):
        return True
    return _curvature(evidence, shape, punch.solution) < DOME_CURVATURE


def is_no_punch(shape: Shape, punch: Candidate) -> bool:
    """Return True if a punch fit has found a pressure that no punch can cause."""
    loading = loading_of(punch)
    return loading is not None and shape is Shape.CIRCLE and loading.peak < NO_PUNCH_PEAK


def _curvature(evidence: Evidence, shape: Shape, solution: Solution) -> float:
    """Return the slope of the residuals against the squared distance from the centre.

    For a rectangle, the distance is measured from the long axis of the rectangle.
    """
    row, col = np.divmod(np.arange(evidence.used.size), evidence.window.cols)
    x, y = col + evidence.window.col - solution.parameters[0], row + evidence.window.row - solution.parameters[1]
    if shape is Shape.CIRCLE:
        outwards, along = np.hypot(x, y) / solution.parameters[2], 0.0
    else:
        angle, long, short = solution.parameters[2:5]
        outwards = np.abs(y * np.cos(angle) - x * np.sin(angle)) / (short / 2)
        along = np.abs(x * np.cos(angle) + y * np.sin(angle)) / (long / 2)
    inside = evidence.used & (outwards < 1) & (along < 1)
    square = outwards[inside] ** 2
    square -= square.mean() if inside.any() else 0.0
    residual = (evidence.values - solution.prediction.values)[inside]
    return float(residual @ square / max(square @ square, 1e-9))
