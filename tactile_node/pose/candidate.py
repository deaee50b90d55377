"""Fit an outline to a contact from one starting point, by weighted least squares.

The starting points follow in closed form from moments up to the fourth order, and are exact for a completely visible
shape. A uniform triangle is an affine image of the equilateral triangle. After whitening, the third moment of the
triangle points to its corners. A side of a rectangle has the length sqrt(12 v), where v is the variance along the side.
The finite size of a taxel adds 1/12 to the variance and -1/60 to the fourth moment.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.linalg.lapack import dposv

from tactile_node.pose.evidence import Evidence
from tactile_node.pose.model_error import Loading, area_and_radius, corrected, covariance_scale, weights_after
from tactile_node.pose.outlines import LEAST_DIMENSION, OUTLINES, Outline, outline_of
from tactile_node.pose.profiles import DOMES, PUNCH, Layer, Profile, expected_log_depth
from tactile_node.pose.skin_model import Model, Prediction, PressureModel
from tactile_node.shape.recognition import Shape

WHITE_CORNERS = np.sqrt(8)  #: Distance from the centre to a corner of an equilateral triangle with variance 1.
LEAST_VARIANCE = 0.05       #: Smallest variance along x and y, because even a single line of taxels has a width.
#: A less likely starting point is chosen if its cost is below this share of the likeliest starting point's cost.
CLEAR_RATIO = 0.25
FIRST_NOISE = 0.05      #: Noise that the coarse pass assumes for each taxel value [fraction of level].
COARSE_TOLERANCE = 0.3  #: The coarse pass stops at a step shorter than this [pitches].
COARSE_STEPS = 10       #: Largest number of steps of the coarse pass.
FINE_TOLERANCE = 0.05   #: The fine pass stops at a step shorter than this [pitches].
FINE_STEPS = 6          #: Largest number of steps of the fine pass.
LONGEST_STEP = 1.0      #: Largest change of a parameter in one step [pitches, radians or relative].
FOLLOWING_STEPS = 3     #: Largest number of steps for following an outline. A contact at rest needs one step.
NEAR_OUTLINE = 0.05     #: Largest change of the outline for which a linear model is accurate [pitches, radians].
NEAR_EXTRAS = 0.1       #: Largest change of the model's extras for which a linear model is accurate.

# The thresholds for domes were chosen on the training seeds so that few punches and few even pressures are mistaken for
# domes.
CIRCLE_PEAK = 0.3        #: A circular contact with a higher fitted peak is not a dome.
BALL_PEAK = -0.05        #: A circular contact with a lower fitted peak may be a ball.
DOME_CURVATURE = -0.005  #: Residuals with a lower curvature may come from a dome.

# A dome can look like an even pressure on deep taxels. The contact may be a dome if both of these limits are exceeded.
BAD_MISFIT = 2.0  #: weighted sum of squared residuals per taxel
DEEP_LAYER = 0.5  #: depth of the taxels [pitches]

#: A circular contact with a lower fitted peak is not a punch. No punch, sharp or rounded, presses this much harder at
#: its centre.
NO_PUNCH_PEAK = -0.3

#: A starting point: the parameters of the outline [pitches, rad], and its handedness.
Start: TypeAlias = tuple[np.ndarray, int]


def first_guesses(shape: Shape, x: np.ndarray, y: np.ndarray, weights: np.ndarray, margin: float) -> list[Start]:
    """Return one or more starting points for a fit, the likeliest first.

    Parameters
    ----------
    shape : Shape
        Shape of the outline.
    x, y : np.ndarray
        Positions of the taxels, (taxels,).
    weights : np.ndarray
        Weight >= 0 of each taxel, (taxels,). At least one weight must be above 0.
    margin : float
        A corner of a triangle also yields a starting point if its misfit exceeds the best corner's misfit by at most
        this margin. For a right triangle, the misfit is an angle [rad]. For an isosceles triangle, the misfit is the
        logarithm of a ratio of lengths.
    """
    weights, place = weights / weights.sum(), x + 1j * y
    centre = complex(weights @ place)
    offsets = place - centre
    xx, yy, xy = weights @ offsets.real**2, weights @ offsets.imag**2, weights @ (offsets.real * offsets.imag)
    covariance = np.array(((max(xx - 1 / 12, LEAST_VARIANCE), xy), (xy, max(yy - 1 / 12, LEAST_VARIANCE))))
    if shape is Shape.CIRCLE:
        return [(np.array((centre.real, centre.imag, np.sqrt(2 * np.trace(covariance)))), 1)]
    if shape is Shape.SQUARE:
        fourth = weights @ offsets**4 + 1 / 60
        side = np.sqrt(6 * np.trace(covariance))
        return [(np.array((centre.real, centre.imag, np.angle(-fourth) / 4, side)), 1)]
    variance, axes = np.linalg.eigh(covariance)
    if shape is Shape.RECTANGLE:
        short, long = np.sqrt(12 * np.maximum(variance, 0.02))
        return [(np.array((centre.real, centre.imag, np.arctan2(axes[1, 1], axes[0, 1]), long, short)), 1)]
    if np.linalg.det(axes) < 0:
        axes = axes * (1, -1)
    scale = np.sqrt(np.maximum(variance, 0.02))
    white = np.stack((offsets.real, offsets.imag), 1) @ axes / scale @ (1, 1j)
    angle = (np.angle(weights @ white**3) + 2 * np.pi * np.arange(3)) / 3
    corners = WHITE_CORNERS * np.column_stack((np.cos(angle), np.sin(angle))) * scale @ axes.T
    of_corners = _right_triangles if shape is Shape.RIGHT_TRIANGLE else _isosceles_triangles
    return of_corners(corners @ (1, 1j) + centre, margin)


def _right_triangles(corners: np.ndarray, margin: float) -> list[Start]:
    """Return right triangles with the right angle at the likeliest of three ``corners``, complex (3,)."""
    following, preceding = np.roll(corners, -1) - corners, np.roll(corners, 1) - corners
    centre, found = corners.mean(), []
    for i in _best(np.abs(np.abs(np.angle(preceding / following)) - np.pi / 2), margin):
        handedness = 1 if abs(following[i]) >= abs(preceding[i]) else -1
        long, short = (following[i], preceding[i]) if handedness > 0 else (preceding[i], following[i])
        found.append((np.array((centre.real, centre.imag, np.angle(long), abs(long), abs(short))), handedness))
    return found


def _isosceles_triangles(corners: np.ndarray, margin: float) -> list[Start]:
    """Return isosceles triangles with the apex at the likeliest of three ``corners``, complex (3,)."""
    following, preceding = np.roll(corners, -1) - corners, np.roll(corners, 1) - corners
    centre, found = corners.mean(), []
    for apex in _best(np.abs(np.log(np.abs(following) / np.abs(preceding))), margin):
        up, base = corners[apex] - centre, abs(corners[(apex + 2) % 3] - corners[(apex + 1) % 3])
        found.append((np.array((centre.real, centre.imag, np.angle(up) - np.pi / 2, base, 1.5 * abs(up))), 1))
    return found


def _best(misfit: np.ndarray, margin: float) -> list[int]:
    order = np.argsort(misfit)
    return [int(i) for i in order if misfit[i] <= misfit[order[0]] + margin]


class Candidate(NamedTuple):
    """An outline that may be the outline of a contact, at the parameters that its fit has reached.

    The fit minimises a cost, the sum of weights (values - fitted)² over the taxels plus the sum of
    precision (parameters - expected)² over the parameters. All lengths are in pitches, and one pitch is the side of a
    block of the evidence. The stages of a fit each return a new candidate: `coarse`, `weighted`, `with_likely_peak` and
    `fine`. In the next frame, the stage `followed` continues from the candidate.
    """

    evidence: Evidence
    shape: Shape
    handedness: int          #: 1, or -1 if the outline is mirrored
    model: Model
    weights: np.ndarray      #: 1 / variance of each value, (taxels,)
    expected: np.ndarray     #: mean of the prior, (parameters,)
    precision: np.ndarray    #: 1 / variance of the prior, (parameters,), above 0, so that one taxel has a solution
    parameters: np.ndarray   #: parameters of the outline, then the extras of the model
    prediction: Prediction   #: prediction of the model, possibly at parameters close to these
    fitted: np.ndarray       #: values that the model predicts at ``parameters``, (taxels,)

    @classmethod
    def coarse(cls, evidence: Evidence, shape: Shape, start: Start, profile: Profile = PUNCH,
               layer: Layer | None = None) -> 'Candidate':
        """Return the candidate after a first pass with equal weights, in which the steps become short.

        Parameters
        ----------
        evidence : Evidence
            Taxels to which the outline is fitted.
        shape : Shape
            Shape of the outline.
        start : Start
            Starting point of the fit.
        profile : Profile
            Pressure profile of the object; ignored for on/off taxels.
        layer : Layer or None
            Layer of a calibrated skin, with lengths in pitches, or None if the layer is unknown.
        """
        guess, handedness = start
        outline = outline_of(shape, handedness)
        if evidence.on_off:
            model = Model(outline, evidence.window)
        else:
            model = PressureModel(outline, evidence.window, guess[:2], profile)
        starts = model.starts(guess)
        expected = np.concatenate((guess, model.expected))
        precision = np.concatenate((_vague(outline, guess), model.precision))
        if isinstance(model, PressureModel) and layer is not None:
            _, radius = area_and_radius(outline.corners(starts[0][:len(guess)]))
            expected[-1], deviation = expected_log_depth(layer, profile, radius)
            precision[-1] = deviation ** -2
        weights = evidence.used / FIRST_NOISE**2
        likely, *others = (cls(evidence, shape, handedness, model, weights, expected, precision, parameters, prediction,
                               prediction.values)
                           for parameters, prediction in ((each, model.predict(each)) for each in starts))
        best = min((other for other in others if other.cost < CLEAR_RATIO * likely.cost), key=lambda each: each.cost,
                   default=likely)
        return best._minimised(COARSE_TOLERANCE, COARSE_STEPS)

    def weighted(self, weights: np.ndarray) -> 'Candidate':
        """Return the candidate at the same parameters, with new ``weights``, (taxels,)."""
        return self._replace(weights=weights)

    def new_weights(self) -> np.ndarray:
        """Return the weights of the taxels, (taxels,), that follow from the candidate's residuals."""
        return weights_after(self.shape, self.evidence, self.fitted, self.prediction.rim)

    def with_likely_peak(self) -> 'Candidate':
        """Return the candidate with the peak's prior taken from the kind of object that its fit resembles.

        If the fit is too uncertain, the candidate is returned unchanged.
        """
        model = self.model
        if not isinstance(model, PressureModel):
            return self
        deviation = np.sqrt(np.linalg.inv(self.information)[model.PEAK, model.PEAK])
        likely = model.likely_peak(self.parameters, deviation)
        if likely is None:
            return self
        expected, precision = self.expected.copy(), self.precision.copy()
        expected[model.PEAK], precision[model.PEAK] = likely
        return self._replace(expected=expected, precision=precision)

    def fine(self) -> 'Candidate':
        """Return the candidate after the fine pass."""
        return self._minimised(FINE_TOLERANCE, FINE_STEPS)

    def followed(self, evidence: Evidence) -> 'Candidate | None':
        """Return the candidate fitted to the next frame, or None if the outline has moved too far.

        The model is treated as linear while the outline stays near the point at which the model was last computed.
        """
        model, prediction, fitted = self.model, self.prediction, self.fitted
        if model.window != evidence.window:
            model = model.on(evidence.window)
            prediction = model.predict(self.parameters)
            fitted = prediction.values
        weights = weights_after(self.shape, evidence, fitted, prediction.rim)
        expected, outline = self.expected.copy(), slice(len(model.outline.parameters))
        expected[outline] = self.parameters[outline]  # the previous outline is as good a guess as the moments
        found = self._replace(evidence=evidence, model=model, weights=weights, expected=expected)
        for _ in range(FOLLOWING_STEPS):
            found = found._at(prediction)
            parameters = found._after_step(damping=0.0)
            if found._is_near(parameters):
                return found._replace(parameters=parameters, fitted=prediction.values_near(parameters))
            prediction = model.predict(parameters)
        return None

    def estimate(self) -> tuple[np.ndarray, np.ndarray, int]:
        """Return the outline's parameters, corrected for the errors of the model, their covariance and the handedness.

        The long side comes first, and the angle is the equivalent angle nearest 0.
        """
        count = len(self.model.outline.parameters)
        covariance = np.linalg.inv(self.information)[:count, :count] * covariance_scale(self.shape, self.evidence)
        fitted, handedness, loading = self.parameters[:count], self.handedness, self.loading
        if loading is None:
            return _canonical(self.shape, fitted, covariance, handedness)
        if loading.is_punch:
            fitted, covariance, handedness = _canonical(self.shape, fitted, covariance, handedness)
        # the first length of a dome lies along the dome's axis, so a dome is corrected before the long side comes first
        fitted, covariance = corrected(self.shape, handedness, fitted, covariance, loading, self.evidence.at_edge)
        return _canonical(self.shape, fitted, covariance, handedness)

    @property
    def information(self) -> np.ndarray:
        """Inverse covariance of the parameters, (parameters, parameters)."""
        information = (self.prediction.jacobian * self.weights) @ self.prediction.jacobian.T
        information.reshape(-1)[::len(self.parameters) + 1] += self.precision
        return information

    @property
    def misfit(self) -> float:
        """Sum of weights (values - fitted)² over the taxels."""
        return float(self.weights @ (self.evidence.values - self.fitted)**2)

    @property
    def cost(self) -> float:
        """Misfit plus the contribution of the prior."""
        return self.misfit + float(self.precision @ (self.parameters - self.expected)**2)

    @property
    def residual(self) -> float:
        """Root mean square of the difference between value and model, as a fraction of the contact's level."""
        residual = (self.evidence.values - self.fitted)[self.evidence.used]
        return float(np.sqrt(residual @ residual / max(len(residual), 1)))

    @property
    def loading(self) -> Loading | None:
        """How the object loads the skin, or None for on/off taxels."""
        if not isinstance(self.model, PressureModel):
            return None
        peak, log_depth = self.parameters[-2:].tolist()
        return Loading(self.model.profile.indenter, peak, float(np.exp(log_depth)))

    def may_be_dome(self) -> bool:
        """Return True if the contact, fitted as a punch, may be a ball, a cone or a cylinder on its side.

        Under a dome, the residuals fall from the centre of the contact outwards. Under a ball, the fitted peak can also
        be negative.
        """
        loading, is_circle = self.loading, self.shape is Shape.CIRCLE
        if loading is None or self.shape not in DOMES or is_circle and loading.peak > CIRCLE_PEAK:
            return False
        if is_circle and (loading.peak < BALL_PEAK or loading.depth > DEEP_LAYER
                          and self.misfit > BAD_MISFIT * np.count_nonzero(self.evidence.used)):
            return True
        return self._curvature() < DOME_CURVATURE

    def is_no_punch(self) -> bool:
        """Return True if a punch fit has found a pressure that no punch can cause."""
        return self.loading is not None and self.shape is Shape.CIRCLE and self.loading.peak < NO_PUNCH_PEAK

    def _minimised(self, tolerance: float, most_steps: int) -> 'Candidate':
        """Return the candidate after Levenberg-Marquardt steps, until one changes the outline by less than a tolerance.

        The steps converge quadratically, so the remaining error is of the order of ``tolerance`` squared.
        """
        damping, best, least, geometry = 1e-3, self, self.cost, len(self.model.outline.parameters)
        for _ in range(most_steps):
            trial = best._at(self.model.predict(best._after_step(damping)))
            size, cost = np.abs(trial.parameters - best.parameters)[:geometry].max(), trial.cost
            if cost <= least:
                best, least, damping = trial, cost, damping / 10
            else:
                damping *= 20
            if size < tolerance:
                break
        return best

    def _at(self, prediction: Prediction) -> 'Candidate':
        """Return the candidate at the parameters of a ``prediction``."""
        return self._replace(parameters=prediction.parameters, prediction=prediction,
                             fitted=prediction.values)

    def _after_step(self, damping: float) -> np.ndarray:
        """Return the parameters after one step, with positive dimensions and with the extras in the model's range."""
        slope = (self.prediction.jacobian @ (self.weights * (self.evidence.values - self.fitted))
                 + self.precision * (self.expected - self.parameters))
        damped = self.information
        diagonal = damped.reshape(-1)[::len(slope) + 1]
        diagonal *= 1 + damping
        step: np.ndarray = dposv(damped, slope)[1]
        step *= min(1.0, LONGEST_STEP / max(np.abs(step).max(), 1e-12))
        step += self.parameters
        extras = len(self.model.outline.parameters)
        dimensions = slice(extras - len(self.model.outline.dimensions), extras)
        step[dimensions] = np.maximum(step[dimensions], LEAST_DIMENSION)
        self.model.bound(step[extras:])
        return step

    def _is_near(self, parameters: np.ndarray) -> bool:
        """Return True if the model, linearised at this candidate, is accurate at ``parameters``."""
        away, outline = np.abs(parameters - self.parameters), len(self.model.outline.parameters)
        return bool(away[:outline].max() < NEAR_OUTLINE and away[outline:].max(initial=0.0) < NEAR_EXTRAS)

    def _curvature(self) -> float:
        """Return the slope of the residuals against the squared distance from the centre.

        For a rectangle, the distance is measured from the long axis of the rectangle.
        """
        evidence, window = self.evidence, self.evidence.window
        row, col = np.divmod(np.arange(evidence.used.size), window.cols)
        x, y = col + window.col - self.parameters[0], row + window.row - self.parameters[1]
        if self.shape is Shape.CIRCLE:
            outwards, along = np.hypot(x, y) / self.parameters[2], 0.0
        else:
            angle, long, short = self.parameters[2:5]
            outwards = np.abs(y * np.cos(angle) - x * np.sin(angle)) / (short / 2)
            along = np.abs(x * np.cos(angle) + y * np.sin(angle)) / (long / 2)
        inside = evidence.used & (outwards < 1) & (along < 1)
        square = outwards[inside] ** 2
        square -= square.mean() if inside.any() else 0.0
        residual = (evidence.values - self.fitted)[inside]
        return float(residual @ square / max(square @ square, 1e-9))


def _vague(outline: Outline, guess: np.ndarray) -> np.ndarray:
    """Return 1 / variance of each parameter of a guess.

    The standard deviation of a length is the length itself. The standard deviation of the position is the largest
    length. The angle is almost unconstrained.
    """
    _, _, dimensions = outline.split(guess)
    lengths = np.concatenate(([dimensions.max()] * 2, *([[1.8]] if outline.symmetry else []), dimensions))
    return 1 / np.maximum(lengths, 1)**2


def _canonical(shape: Shape, parameters: np.ndarray, covariance: np.ndarray,
               handedness: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Return the outline with the long side first and its angle reduced to the equivalent angle nearest 0."""
    symmetry = OUTLINES[shape].symmetry
    if not symmetry:
        return parameters, covariance, handedness
    parameters = parameters.copy()
    if shape in (Shape.RECTANGLE, Shape.RIGHT_TRIANGLE) and parameters[4] > parameters[3]:
        swap = [0, 1, 2, 4, 3]
        parameters, covariance = parameters[swap], covariance[np.ix_(swap, swap)]
        parameters[2] += handedness * np.pi / 2
        handedness = -handedness if shape is Shape.RIGHT_TRIANGLE else handedness
    parameters[2] = nearest_zero(parameters[2], symmetry)
    return parameters, covariance, handedness


def nearest_zero(angle: float, symmetry: int) -> float:
    """Return the angle in (-π/symmetry, π/symmetry] that is equivalent to ``angle`` under the symmetry."""
    period = 2 * np.pi / symmetry
    return -((period / 2 - angle) % period - period / 2)
