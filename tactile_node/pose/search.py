"""Find the likeliest outline of a shape, by a search from several starting points or by following the last outline."""

from typing import NamedTuple

import numpy as np

from tactile_node.pose.candidate import (
    Candidate,
    coarse,
    fine,
    is_no_punch,
    loading_of,
    may_be_dome,
    reweighted,
    with_likely_peak,
)
from tactile_node.pose.evidence import Evidence
from tactile_node.pose.first_guess import guesses, moments_of
from tactile_node.pose.least_squares import Place, is_near, solved
from tactile_node.pose.model_error import corrected, covariance_scale, weights_after
from tactile_node.pose.outlines import OUTLINES, Outline
from tactile_node.pose.profiles import DOMES, Layer
from tactile_node.shape.recognition import Shape

#: Corners of a triangle are tried if their angles, or the logarithms of their side ratios, differ by at most this.
CORNER_MARGIN = 0.15
CORNER_MARGIN_ON_OFF = 0.35  #: Value of CORNER_MARGIN for on/off taxels.
AMBIGUOUS_MISFIT = 6.0  #: Two fits cannot be distinguished if their sums of squares differ by less than this.

#: At the pad's edge, AMBIGUOUS_MISFIT is larger by this factor, because the part beyond the edge is a guess.
EDGE_AMBIGUITY = 20.0
PUNCH_RATIO = 1.4  #: A punch fit is not refined if a dome fit's sum of squares is smaller by this factor.

#: A fit is not refined if its misfit after the first pass exceeds the best misfit by more than this.
HOPELESS_MISFIT = 500.0
FOLLOWING_STEPS = 3  #: Largest number of steps for following an outline. A contact at rest needs one step.
WORSE_RATIO = 1.4  #: Factor by which a residual may grow before the outline is searched for again.
LEAST_RESIDUAL = 0.03  #: WORSE_RATIO is applied to this residual if the search has found a smaller one.


class Estimate(NamedTuple):
    """An outline in pitches, with the long side first and its angle reduced to the equivalent angle nearest 0."""

    parameters: np.ndarray
    covariance: np.ndarray
    handedness: int
    symmetry: int


class Found(NamedTuple):
    """The likeliest outline of a shape."""

    shape: Shape
    candidate: Candidate
    place: Place  #: point at which the model was last computed
    estimate: Estimate
    others: np.ndarray        #: part of the covariance due to other, nearly as likely outlines
    residual: float  #: root mean square of the difference between value and model, as a fraction of the contact's level
    searched_residual: float  #: residual of the latest search
    on_off: bool
    at_edge: bool


def search(evidence: Evidence, shape: Shape, layer: Layer | None = None) -> Found:
    """Return the likeliest outline of a shape.

    Parameters
    ----------
    evidence : Evidence
        Taxels to which the outline is fitted.
    shape : Shape
        One of the five shapes.
    layer : Layer or None
        Layer of a calibrated skin, with lengths in pitches, or None if the layer is unknown.
    """
    candidates = _coarse_fits(evidence, shape, layer)
    best = min(candidates, key=_misfit)
    weights = weights_after(shape, best.solution.prediction, evidence)
    candidates = [with_likely_peak(reweighted(candidate, weights)) for candidate in candidates]
    within = min(map(_misfit, candidates)) + HOPELESS_MISFIT
    candidates = sorted((fine(candidate) for candidate in candidates if _misfit(candidate) < within), key=_misfit)
    estimate, others = _together(shape, evidence, candidates)
    best, residual = candidates[0], _residual(evidence, candidates[0])
    return Found(shape, best, Place(*best.solution[:2]), estimate, others, residual, residual, evidence.on_off,
                 evidence.at_edge)


def follow(evidence: Evidence, before: Found) -> Found | None:
    """Return the outline followed from the previous frame, or None if a new search is needed.

    The model is treated as linear while the outline stays near the point at which the model was last computed. The part
    of the covariance due to other outlines is kept from the last search.

    Parameters
    ----------
    evidence : Evidence
        Taxels to which the outline is fitted.
    before : Found
        Outline found in the previous frame.
    """
    if evidence.on_off != before.on_off or evidence.at_edge != before.at_edge:
        return None
    problem, at, start = before.candidate.problem, before.place, before.candidate.solution.parameters
    if problem.model.window != evidence.window:
        model = problem.model.on(evidence.window)
        problem, at = problem._replace(model=model), Place(start, model.predict(start))
    weights = weights_after(before.shape, at.shown_at(start), evidence)
    expected = before.candidate.problem.expected.copy()
    outline = slice(len(problem.model.outline.parameters))
    expected[outline] = start[outline]  # the previous outline is as good a guess as the moments
    problem = problem._replace(values=evidence.values, weights=weights, expected=expected)
    for _ in range(FOLLOWING_STEPS):
        solution = solved(problem, at)
        if is_near(problem.model, solution.parameters, at.parameters):
            break
        at = Place(solution.parameters, problem.model.predict(solution.parameters))
    else:
        return None
    candidate = Candidate(problem, solution, before.candidate.handedness)
    residual = _residual(evidence, candidate)
    if residual > WORSE_RATIO * max(before.searched_residual, LEAST_RESIDUAL):
        return None
    estimate = _estimate(before.shape, evidence, candidate, solution.information)
    estimate = estimate._replace(covariance=estimate.covariance + before.others, symmetry=before.estimate.symmetry)
    return before._replace(candidate=candidate, place=at, estimate=estimate, residual=residual)


def _residual(evidence: Evidence, found: Candidate) -> float:
    residual = (evidence.values - found.solution.prediction.values)[evidence.used]
    return float(np.sqrt(residual @ residual / max(len(residual), 1)))


def _coarse_fits(evidence: Evidence, shape: Shape, layer: Layer | None) -> list[Candidate]:
    """Return coarse fits from every starting point, including fits as a dome if the contact may be a dome.

    The lengths of ``layer`` are in pitches.
    """
    y, x = np.indices(evidence.solid.shape).reshape(2, -1)
    moments = moments_of(x + evidence.window.col, y + evidence.window.row, evidence.solid.reshape(-1))
    margin = np.inf if evidence.at_edge else CORNER_MARGIN_ON_OFF if evidence.on_off else CORNER_MARGIN
    starts = guesses(shape, moments, margin)
    punches = [coarse(evidence, shape, guess, layer=layer) for guess in starts]
    if not may_be_dome(evidence, shape, punches[0]):
        return punches
    domes = [coarse(evidence, shape, starts[0], dome, layer) for dome in DOMES[shape]]
    if is_no_punch(shape, punches[0]):
        return domes
    # A punch fit that is worse than a dome fit is dropped. Otherwise the new weights would treat the dome's tip as
    # outliers, and the rest would look like an even pressure on an outline that is too small.
    least = min(map(_misfit, domes))
    return [punch for punch in punches if _misfit(punch) < PUNCH_RATIO * least] + domes


def _misfit(candidate: Candidate) -> float:
    """Return the misfit, by which candidates are compared because their costs contain different priors."""
    return candidate.solution.misfit


def _together(shape: Shape, evidence: Evidence, candidates: list[Candidate]) -> tuple[Estimate, np.ndarray]:
    """Return the best estimate, and the part of its covariance that is due to other likely candidates."""
    last = (reweighted(each, weights_after(shape, each.solution.prediction, evidence)) for each in candidates)
    estimates = [_estimate(shape, evidence, each, weighted.solution.information)
                 for each, weighted in zip(candidates, last)]
    best, costs = estimates[0], np.array([_misfit(candidate) for candidate in candidates])
    if evidence.at_edge and not evidence.on_off:
        costs /= EDGE_AMBIGUITY
    if shape is Shape.ISOSCELES_TRIANGLE and any(
            cost - costs[0] < AMBIGUOUS_MISFIT and abs(_nearest_zero(other.parameters[2] - best.parameters[2], 1)) > 1
            for cost, other in zip(costs[1:], estimates[1:])):
        best = best._replace(symmetry=3)
    shares = np.exp((costs[0] - costs) / 2)
    covariance, apart_from_best = np.zeros((2, *best.covariance.shape))
    for share, estimate in zip(shares / shares.sum(), estimates):
        apart = estimate.parameters - best.parameters
        if best.symmetry:
            apart[2] = _nearest_zero(apart[2], best.symmetry)
        spread = np.outer(apart, apart)
        covariance += share * (estimate.covariance + spread)
        apart_from_best += share * spread
    return best._replace(covariance=covariance), apart_from_best


def _estimate(shape: Shape, evidence: Evidence, found: Candidate, information: np.ndarray) -> Estimate:
    count = len(found.problem.model.outline.parameters)
    covariance = np.linalg.inv(information)[:count, :count] * covariance_scale(shape, evidence)
    fitted = found.solution.parameters[:count]
    loading = loading_of(found)
    if loading is not None and not loading.is_punch:  # the first length of a dome lies along the dome's axis
        fitted, covariance = corrected(shape, found.handedness, fitted, covariance, loading, evidence.at_edge)
    parameters, handedness, covariance = _canonical(shape, found.handedness, fitted, covariance)
    if loading is not None and loading.is_punch:
        parameters, covariance = corrected(shape, handedness, parameters, covariance, loading, evidence.at_edge)
        parameters, handedness, covariance = _canonical(shape, handedness, parameters, covariance)
    return Estimate(parameters, covariance, handedness, OUTLINES[shape].symmetry)


def _canonical(shape: Shape, handedness: int, parameters: np.ndarray,
               covariance: np.ndarray) -> tuple[np.ndarray, int, np.ndarray]:
    """Return the outline with the long side first and its angle reduced to the equivalent angle nearest 0."""
    outline: Outline = OUTLINES[shape]
    if not outline.symmetry:
        return parameters, handedness, covariance
    parameters = parameters.copy()
    if shape in (Shape.RECTANGLE, Shape.RIGHT_TRIANGLE) and parameters[4] > parameters[3]:
        swap = [0, 1, 2, 4, 3]
        parameters, covariance = parameters[swap], covariance[np.ix_(swap, swap)]
        parameters[2] += handedness * np.pi / 2
        handedness = -handedness if shape is Shape.RIGHT_TRIANGLE else handedness
    parameters[2] = _nearest_zero(parameters[2], outline.symmetry)
    return parameters, handedness, covariance


def _nearest_zero(angle: float, symmetry: int) -> float:
    """Return the equivalent angle in (-π/symmetry, π/symmetry]."""
    period = 2 * np.pi / symmetry
    return -((period / 2 - angle) % period - period / 2)
