"""Pose and size of a contact of known shape: its outline, fitted to the taxel values by least squares."""

from typing import NamedTuple

import numpy as np

from tactile_node.contact.neighbours import touches_edge
from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.press import are_on_off
from tactile_node.contact.visibility import Visibility, visibility_of
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
from tactile_node.pose.evidence import Evidence, checked, gather
from tactile_node.pose.first_guess import guesses, moments_of
from tactile_node.pose.least_squares import in_blocks, size_of
from tactile_node.pose.model_error import corrected, covariance_scale, weights_after
from tactile_node.pose.moments import check_pitch
from tactile_node.pose.outlines import OUTLINES, Outline, outline_of, rotation
from tactile_node.pose.profiles import DOMES, Indenter, Layer, check_layer
from tactile_node.pose.rim import Rim, is_cut, reach, rim_of
from tactile_node.shape.recognition import Shape, ShapeClass, TaughtShape
from tactile_node.taxel_frame import read_only

CORNER_MARGIN = 0.15  #: corners of a triangle are tried when their angles, or log lengths, are so close
CORNER_MARGIN_ON_OFF = 0.35
AMBIGUOUS_MISFIT = 6.0       #: two fits whose sums of squares differ by less cannot be distinguished
EDGE_AMBIGUITY = 20.0        #: factor of that at the pad's edge: what lies beyond is a guess
PUNCH_RATIO = 1.4       #: a punch is not refined beside a dome whose sum of squares is lower by this factor
HOPELESS_MISFIT = 500.0      #: a fit that is worse by more after the first pass is not refined


class ShapeFit(NamedTuple):
    """Pose and size in the pad's frame (metres; origin at taxel (0, 0), x along columns, y along rows)."""

    shape: Shape
    centre: tuple[float, float]        #: centre of area [m]
    angle: float                       #: direction of the shape's x axis, x to y positive [rad]; 0 for a circle
    #: Looks the same when rotated by 2π/symmetry; 0: by any angle; 3: an isosceles triangle that these taxels do not
    #: distinguish from an equilateral one, its apex may be any corner.
    symmetry: int
    handedness: int                    #: right triangle: 1, or -1 when mirrored; else 0
    dimension_names: tuple[str, ...]   #: as in `outlines.OUTLINES`
    dimensions: tuple[float, ...]      #: [m]
    #: of each dimension: it is the length that is seen, and the contact goes on where nothing is seen (`fit_contact`)
    is_bound: tuple[bool, ...]
    covariance: np.ndarray             #: covariance of ``parameter_names``, [m, rad]
    residual: float                    #: root mean square of value - model, fraction of the contact's level
    outline: np.ndarray                #: corners, (n, 2), in the sense from x to y [m]
    indenter: Indenter | None          #: what presses, as far as its pressure shows; None: on/off taxels
    peak: float                        #: 0: an even pressure; about 1: a punch's or a dome's; NaN: on/off taxels
    depth: float  #: depth of the taxels below the skin's surface, as fitted [m]; NaN: on/off taxels

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """What ``covariance`` is of: x, y, angle (unless a circle), dimensions."""
        return OUTLINES[self.shape].parameters

    @property
    def parameters(self) -> np.ndarray:
        """The values of ``parameter_names``."""
        return np.array((*self.centre, *((self.angle,) if self.symmetry else ()), *self.dimensions))


def fit_shape(values: np.ndarray, mask: np.ndarray, shape: ShapeClass, pitch: float = 1.0,
              layer: Layer | None = None) -> ShapeFit | None:
    """Fit the outline of ``shape`` to the contact ``mask`` of a frame; None when the shape has none.

    ``values``: (rows, cols), any unit that grows with pressure, NaN = no valid value; or an on/off pattern
    (bool). ``mask``: bool, the contact's taxels. ``pitch`` [m]. ``layer``: of a calibrated skin; None: not known. A
    wide contact is fitted in blocks of taxels. Raises InputError for other arrays, ConfigurationError for another
    pitch or layer.

    >>> fit = fit_shape(np.pad(np.ones((4, 4)), 3), np.pad(np.ones((4, 4), bool), 3), Shape.SQUARE)
    >>> [round(length, 1) for length in (*fit.centre, *fit.dimensions)]
    [4.5, 4.5, 4.0]
    """
    check_pitch(pitch)
    if layer is not None:
        check_layer(layer, pitch)
    if isinstance(shape, TaughtShape) or shape not in OUTLINES:
        return None
    values, mask = checked(values, mask)
    size = size_of(mask)
    blocks = in_blocks(values, mask, size) if size > 1 else None
    if blocks is None or not blocks.mask.any():  # of a line no block is half full
        return fit_evidence(gather(values, mask), Shape(shape), pitch, layer)
    fit = fit_evidence(gather(blocks.values, blocks.mask, touches_edge(mask)), Shape(shape), pitch * size, layer)
    x, y = blocks.x * pitch, blocks.y * pitch
    return fit._replace(centre=(fit.centre[0] + x, fit.centre[1] + y), outline=read_only(fit.outline + (x, y)))


def fit_evidence(evidence: Evidence, shape: Shape, pitch: float, layer: Layer | None = None) -> ShapeFit:
    """Fit the outline of ``shape``, one of the five, to ``evidence``; ``pitch`` [m] of its taxels, ``layer`` [m]."""
    candidates = _coarse_fits(evidence, shape, layer._replace(depth=layer.depth / pitch) if layer else None)
    best = min(candidates, key=_misfit)
    weights = weights_after(shape, best.solution.prediction, evidence)
    candidates = [with_likely_peak(reweighted(candidate, weights)) for candidate in candidates]
    within = min(map(_misfit, candidates)) + HOPELESS_MISFIT
    candidates = sorted((fine(candidate) for candidate in candidates if _misfit(candidate) < within), key=_misfit)
    estimate = _together(shape, evidence, candidates)
    return _in_metres(shape, pitch, evidence, found=candidates[0], estimate=estimate)


def _coarse_fits(evidence: Evidence, shape: Shape, layer: Layer | None) -> list[Candidate]:
    """From every start, and as a dome where it may be one; ``layer`` in pitches."""
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
    # Weights would take a tip for outliers; what is left looks like an even pressure on too small an outline
    least = min(map(_misfit, domes))
    return [punch for punch in punches if _misfit(punch) < PUNCH_RATIO * least] + domes


def _misfit(candidate: Candidate) -> float:
    """What candidates are compared by: their priors differ."""
    return candidate.solution.misfit


class _Estimate(NamedTuple):
    """In pitches, canonical."""

    parameters: np.ndarray
    covariance: np.ndarray
    handedness: int
    symmetry: int


def _together(shape: Shape, evidence: Evidence, candidates: list[Candidate]) -> _Estimate:
    """The best candidate; the others, as far as they are likely too, widen its covariance."""
    estimates = [_estimate(shape, evidence, candidate) for candidate in candidates]
    best, costs = estimates[0], np.array([_misfit(candidate) for candidate in candidates])
    if evidence.at_edge and not evidence.on_off:
        costs /= EDGE_AMBIGUITY
    if shape is Shape.ISOSCELES_TRIANGLE and any(
            cost - costs[0] < AMBIGUOUS_MISFIT and abs(_nearest_zero(other.parameters[2] - best.parameters[2], 1)) > 1
            for cost, other in zip(costs[1:], estimates[1:])):
        best = best._replace(symmetry=3)
    shares = np.exp((costs[0] - costs) / 2)
    covariance = np.zeros_like(best.covariance)
    for share, estimate in zip(shares / shares.sum(), estimates):
        apart = estimate.parameters - best.parameters
        if best.symmetry:
            apart[2] = _nearest_zero(apart[2], best.symmetry)
        covariance += share * (estimate.covariance + np.outer(apart, apart))
    return best._replace(covariance=covariance)


def _estimate(shape: Shape, evidence: Evidence, found: Candidate) -> _Estimate:
    last = reweighted(found, weights_after(shape, found.solution.prediction, evidence)).solution
    count = len(found.problem.model.outline.parameters)
    covariance = np.linalg.inv(last.information)[:count, :count] * covariance_scale(shape, evidence)
    fitted = found.solution.parameters[:count]
    loading = loading_of(found)
    if loading is not None and not loading.is_punch:  # a dome's first length is along its axis
        fitted, covariance = corrected(shape, found.handedness, fitted, covariance, loading, evidence.at_edge)
    parameters, handedness, covariance = _canonical(shape, found.handedness, fitted, covariance)
    if loading is not None and loading.is_punch:
        parameters, covariance = corrected(shape, handedness, parameters, covariance, loading, evidence.at_edge)
        parameters, handedness, covariance = _canonical(shape, handedness, parameters, covariance)
    return _Estimate(parameters, covariance, handedness, OUTLINES[shape].symmetry)


def _in_metres(shape: Shape, pitch: float, evidence: Evidence, found: Candidate,
               estimate: _Estimate) -> ShapeFit:
    outline = outline_of(shape, estimate.handedness)
    scale = np.array([1.0 if name == 'angle' else pitch for name in outline.parameters])
    corners = outline.corners(estimate.parameters) * pitch
    covariance = estimate.covariance * np.outer(scale, scale)
    corners.flags.writeable = covariance.flags.writeable = False
    centre, angle, dimensions = outline.split(estimate.parameters * scale)
    handedness = estimate.handedness if shape is Shape.RIGHT_TRIANGLE else 0
    loading = loading_of(found)
    residual = (evidence.values - found.solution.prediction.values)[evidence.used]
    return ShapeFit(shape=shape, centre=tuple(centre.tolist()), angle=angle, symmetry=estimate.symmetry,
                    handedness=handedness, dimension_names=outline.dimensions, dimensions=tuple(dimensions.tolist()),
                    is_bound=(False,) * len(dimensions), covariance=covariance,
                    residual=float(np.sqrt(residual @ residual / max(len(residual), 1))), outline=corners,
                    indenter=loading.indenter if loading else None, peak=loading.peak if loading else np.nan,
                    depth=loading.depth * pitch if loading else np.nan)


def _canonical(shape: Shape, handedness: int, parameters: np.ndarray,
               covariance: np.ndarray) -> tuple[np.ndarray, int, np.ndarray]:
    """The long side first; of the equivalent angles the one nearest 0."""
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
    """Return the one of all equivalent angles that is in (-π/symmetry, π/symmetry]."""
    period = 2 * np.pi / symmetry
    return -((period / 2 - angle) % period - period / 2)


#: Their own axes run from side to side of them; what a triangle is completed by, its deviations say
UPRIGHT_SHAPES = (Shape.CIRCLE, Shape.SQUARE, Shape.RECTANGLE)


def fit_contact(pattern: ContactPattern, shape: ShapeClass, pitch: float = 1.0, layer: Layer | None = None,
                visibility: Visibility | None = None) -> ShapeFit | None:
    """Fit ``shape`` to the contact of ``pattern`` as `fit_shape` does; ``visibility`` of it, None: not known yet.

    A length of a circle, a square or a rectangle that goes on where nothing is seen is that of what is seen, a bound. A
    triangle is completed, and its deviations say how well.
    """
    taxels = pattern.mask if are_on_off(pattern.values) else pattern.values
    fit = fit_shape(taxels, pattern.mask, shape, pitch, layer)
    if fit is None or fit.shape not in UPRIGHT_SHAPES:
        return fit
    visibility = visibility or visibility_of(pattern)
    is_whole = not (visibility.at_edge or visibility.outline_hidden)
    return fit if is_whole else _bounded(fit, rim_of(pattern, visibility), pitch)


def _bounded(fit: ShapeFit, rim: Rim, pitch: float) -> ShapeFit:
    is_bound = is_cut(rim, fit.angle)
    if fit.shape is not Shape.RECTANGLE:
        is_bound[:] = is_bound.any()
    if not is_bound.any():
        return fit
    axes = rotation(fit.angle)
    per_dimension = 2.0 if fit.shape is Shape.CIRCLE else 1.0
    middle, half = axes @ fit.centre, per_dimension * np.resize(fit.dimensions, 2) / 2
    ends = reach(rim, np.array([fit.angle]))[..., 0] * pitch
    low, high = np.maximum(middle - half, ends[:, 0]), np.minimum(middle + half, ends[:, 1])
    seen = np.where(is_bound, high - low, 2 * half)
    dimensions = (seen if fit.shape is Shape.RECTANGLE else seen.max(keepdims=True)) / per_dimension
    centre = np.where(is_bound, (low + high) / 2, middle) @ axes
    return fit._replace(
        centre=tuple(centre.tolist()), dimensions=tuple(dimensions.tolist()),
        is_bound=tuple(is_bound.tolist()[:len(dimensions)]),
        outline=read_only(OUTLINES[fit.shape].placed(centre, fit.angle, dimensions)))
