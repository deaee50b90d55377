"""Pose and size of a contact of known shape: its outline, fitted to the taxel values by least squares."""

from typing import NamedTuple

import numpy as np

from tactile_node.pose.evidence import Evidence, gather
from tactile_node.pose.first_guess import Guess, guesses, moments_of
from tactile_node.pose.least_squares import Solution, evaluate, minimise
from tactile_node.pose.noise import covariance_scale, weights_after
from tactile_node.pose.outlines import OUTLINES, Outline, outline_of
from tactile_node.pose.skin_model import Model, PatternModel, PressureModel
from tactile_node.shape.recognition import Shape

COARSE = 0.1  #: when the first pass stops [pitches]
FINE = 0.02   #: and the second


class ShapeFit(NamedTuple):
    """Pose and size in the pad's frame (metres; origin at taxel (0, 0), x along columns, y along rows)."""

    shape: Shape
    centre: tuple[float, float]        #: centre of area [m]
    turn: float                        #: of the shape's x axis, x to y positive [rad]; 0 for a circle
    symmetry: int                      #: a turn by 2π/symmetry looks the same; 0: any turn does
    hand: int                          #: right triangle: 1, or -1 when mirrored; else 0
    dimension_names: tuple[str, ...]   #: as in `outlines.OUTLINES`
    dimensions: tuple[float, ...]      #: [m]
    covariance: np.ndarray             #: of ``parameter_names``, [m, rad]
    residual: float                    #: root mean square of value - model, fraction of the contact's level
    outline: np.ndarray                #: corners, (n, 2), in the sense from x to y [m]

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """What ``covariance`` is of: x, y, turn (unless a circle), dimensions."""
        return OUTLINES[self.shape].parameters

    @property
    def parameters(self) -> np.ndarray:
        """Their values."""
        return np.array((*self.centre, *((self.turn,) if self.symmetry else ()), *self.dimensions))

    @property
    def apex_angle(self) -> float:
        """Of an isosceles triangle [rad]; NaN for others."""
        if self.shape is not Shape.ISOSCELES_TRIANGLE:
            return float('nan')
        return float(2 * np.arctan2(self.dimensions[0] / 2, self.dimensions[1]))


def fit_shape(values: np.ndarray, mask: np.ndarray, shape: Shape, pitch: float = 1.0) -> ShapeFit | None:
    """Fit the outline of ``shape`` to the contact ``mask`` of a frame; None when the shape has none.

    ``values``: (rows, cols), any unit that grows with pressure, NaN = no valid value; or an on/off pattern
    (bool). ``mask``: bool, the contact's taxels. ``pitch`` [m]. Raises InputError for anything else.

    >>> fit = fit_shape(np.pad(np.ones((4, 4)), 3), np.pad(np.ones((4, 4), bool), 3), Shape.SQUARE)
    >>> fit.centre, round(fit.dimensions[0], 2)
    ((4.5, 4.5), 4.0)
    """
    if shape not in OUTLINES:
        return None
    evidence = gather(values, mask)
    y, x = np.indices(evidence.solid.shape).reshape(2, -1)
    moments = moments_of(x + evidence.window.col, y + evidence.window.row, evidence.solid.reshape(-1))
    fits = [(_coarse(evidence, shape, guess), guess) for guess in guesses(shape, moments)]
    (model, solution), guess = min(fits, key=lambda fit: fit[0][1].cost)
    return _result(shape, guess.hand, pitch, evidence, *_fine(evidence, model, solution, shape))


def _coarse(evidence: Evidence, shape: Shape, guess: Guess) -> tuple[Model, Solution]:
    outline = outline_of(shape, guess.hand)
    if evidence.on_off:
        model: Model = PatternModel(outline, evidence.window)
    else:
        model = PressureModel(outline, evidence.window, guess.parameters[:2])
    weights = 400.0 * evidence.used.reshape(-1)  # values are good to about 1/20
    start = np.concatenate((guess.parameters, model.start))
    values = evidence.values.reshape(-1)
    at = evaluate(model, start, model.predict(start), values, weights)
    return model, minimise(model, at, values, weights, tolerance=COARSE, max_steps=10)


def _fine(evidence: Evidence, model: Model, solution: Solution, shape: Shape) -> tuple[Solution, np.ndarray, float]:
    """Return the solution with weights by the noise found, the covariance of the outline and the residual."""
    values, used = evidence.values.reshape(-1), evidence.used.reshape(-1)
    for max_steps in (6, 0):  # the weights of the covariance are those of the last residuals
        weights = weights_after(solution.prediction, values, used, evidence.on_off)
        solution = evaluate(model, solution.parameters, solution.prediction, values, weights)
        solution = minimise(model, solution, values, weights, tolerance=FINE, max_steps=max_steps)
    count = len(model.outline.parameters)
    covariance = np.linalg.inv(solution.information)[:count, :count] * covariance_scale(shape, evidence.on_off)
    residual = (values - solution.prediction.values)[used]
    return solution, covariance, float(np.sqrt(residual @ residual / max(len(residual), 1)))


def _result(shape: Shape, hand: int, pitch: float, evidence: Evidence, solution: Solution, covariance: np.ndarray,
            residual: float) -> ShapeFit:
    outline = outline_of(shape, hand)
    parameters, hand, covariance = _canonical(shape, hand, solution.parameters[:len(covariance)], covariance)
    outline = outline_of(shape, hand)
    scale = np.array([1.0 if name == 'turn' else pitch for name in outline.parameters])
    corners = outline.corners(parameters) * pitch
    covariance = covariance * np.outer(scale, scale)
    corners.flags.writeable = covariance.flags.writeable = False
    centre, turn, dimensions = outline.split(parameters * scale)
    return ShapeFit(shape, tuple(centre.tolist()), turn, outline.symmetry,
                    hand if shape is Shape.RIGHT_TRIANGLE else 0, outline.dimensions, tuple(dimensions.tolist()),
                    covariance, residual, corners)


def _canonical(shape: Shape, hand: int, parameters: np.ndarray,
               covariance: np.ndarray) -> tuple[np.ndarray, int, np.ndarray]:
    """The long side first, the turn the one nearest 0."""
    outline: Outline = OUTLINES[shape]
    if not outline.symmetry:
        return parameters, hand, covariance
    parameters = parameters.copy()
    if shape in (Shape.RECTANGLE, Shape.RIGHT_TRIANGLE) and parameters[4] > parameters[3]:
        swap = [0, 1, 2, 4, 3]
        parameters, covariance = parameters[swap], covariance[np.ix_(swap, swap)]
        parameters[2] += hand * np.pi / 2
        hand = -hand if shape is Shape.RIGHT_TRIANGLE else hand
    period = 2 * np.pi / outline.symmetry
    parameters[2] = -((-parameters[2] + period / 2) % period - period / 2)
    return parameters, hand, covariance
