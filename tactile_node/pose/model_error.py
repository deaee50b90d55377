"""Correct the systematic errors of the punch and dome models for each shape.

The models have systematic errors because corners carry less load and because the rounding of edges is unknown.

The errors were measured on contacts simulated with the training seeds (bench/pose_calibration.py). The tables use the
shape's own frame, with the position in inscribed radii, the angle in radians and the dimensions as relative errors.
Under an even pressure, no error is subtracted.
"""

from typing import NamedTuple

import numpy as np

from tactile_node.pose.evidence import Evidence, upper_median
from tactile_node.pose.outlines import LEAST_DIMENSION, Outline, outline_of, rotation
from tactile_node.pose.profiles import Indenter
from tactile_node.shape.recognition import Shape

MOST_PEAK = 1.2       #: Upper limit applied to the peak of a punch.
MOST_DOME_PEAK = 2.0  #: Upper limit applied to peak - 1 of a dome.

# A fit never reports smaller standard deviations than these, because real taxels differ from modelled ones and a layer
# differs from a half-space.
LEAST_PLACE = 0.003  #: [pitches]
LEAST_ANGLE = 0.001  #: [radians]
LEAST_LENGTH = 0.02  #: [pitches]

# The errors were not measured beyond these limits.
LEAST_AREA = 12.0   #: smallest area [taxels]
LEAST_RADIUS = 1.4  #: smallest inscribed radius [pitches]
MOST_DEPTH = 1.3    #: largest depth of the taxels [pitches]
EDGE_FACTOR = 1.4   #: Factor applied to the standard deviation of a contact at the pad's edge.
FEW_TAXELS = 26.0   #: Contact area at which the standard deviation is twice that of a large contact [taxels].


class Loading(NamedTuple):
    """Type of load that a fit has found: how the object presses on the skin."""

    indenter: Indenter
    peak: float   #: 0 for an even pressure, 1 for the pressure of the profile
    depth: float  #: depth of the taxels [pitches]

    @property
    def is_punch(self) -> bool:
        """True if the object is a flat punch."""
        return self.indenter is Indenter.FLAT_PUNCH


class ModelError(NamedTuple):
    """Error terms for x, y, the angle (except for a circle) and the dimensions."""

    bias: tuple[float, ...]       #: constant error under a punch or a dome
    of_size: tuple[float, ...]    #: coefficient of 1 / inscribed radius, with the radius in pitches
    of_ratio: tuple[float, ...]   #: coefficient of the log ratio of the two dimensions
    of_depth: tuple[float, ...]   #: coefficient of the taxels' depth / inscribed radius
    of_peak: tuple[float, ...]    #: coefficient of peak - 1
    deviation: tuple[float, ...]  #: standard deviation of the error about the sum of these terms


PUNCH_ERRORS = {
    Shape.CIRCLE: ModelError((0, 0, 0.003), (0, 0, -0.035), (0, 0, 0), (0, 0, -0.040), (0, 0, 0),
                             (0.006, 0.007, 0.013)),
    Shape.SQUARE: ModelError((0, 0, 0, -0.019), (0, 0, 0, 0.013), (0, 0, 0, 0), (0, 0, 0, 0.032),
                             (0, 0, 0, 0), (0.009, 0.011, 0.013, 0.014)),
    Shape.RECTANGLE: ModelError((0, 0, 0, 0, -0.041), (0, 0, 0, -0.029, 0.029), (0, 0, 0, 0.016, 0.049),
                                (0, 0, 0, -0.033, 0.115), (0, 0, 0, 0, 0), (0.009, 0.010, 0.007, 0.011, 0.025)),
    Shape.RIGHT_TRIANGLE: ModelError((-0.066, 0.006, 0.001, -0.028, -0.020), (0.084, -0.005, -0.004, 0.076, 0.082),
                                     (0.063, -0.006, -0.005, 0.013, -0.029), (0.118, -0.007, 0.002, 0.064, 0.112),
                                     (0, 0, 0, 0, 0), (0.018, 0.013, 0.005, 0.012, 0.021)),
    Shape.ISOSCELES_TRIANGLE: ModelError((0, -0.004, 0, -0.040, -0.034), (0, 0.029, 0, 0.099, 0.088),
                                         (0, -0.022, 0, 0.018, -0.018), (0, 0.027, 0, 0.054, 0.065),
                                         (0, 0, 0, 0, 0), (0.011, 0.012, 0.004, 0.018, 0.017)),
}


DOME_ERRORS = {
    Indenter.BALL: ModelError((0, 0, -0.001), (0, 0, 0), (0, 0, 0), (0, 0, -0.124), (0, 0, 0.057),
                              (0.005, 0.004, 0.016)),
    Indenter.CONE: ModelError((0, 0, -0.031), (0, 0, 0.180), (0, 0, 0), (0, 0, -0.213), (0, 0, 0.170),
                              (0.005, 0.007, 0.023)),
    Indenter.LYING_CYLINDER: ModelError((0, 0, 0, 0.017, 0.034), (0, 0, 0, -0.007, -0.017), (0, 0, 0, 0.006, -0.026),
                                        (0, 0, 0, -0.031, 0.012), (0, 0, 0, -0.029, 0.126),
                                        (0.015, 0.007, 0.004, 0.010, 0.011)),
}


def corrected(shape: Shape, handedness: int, parameters: np.ndarray, covariance: np.ndarray,
              loading: Loading, at_edge: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return the parameters and the covariance of a fit, corrected for the errors of the model.

    Parameters
    ----------
    shape : Shape
        Shape of the outline.
    handedness : int
        1 or -1 (mirrored).
    parameters : np.ndarray
        Fitted parameters of the outline, with lengths in pitches.
    covariance : np.ndarray
        Covariance of ``parameters``.
    loading : Loading
        How the object loads the skin.
    at_edge : bool
        True if part of the contact may lie beyond the pad.
    """
    outline, error, share = outline_of(shape, handedness), errors_of(shape, loading), share_of(loading)
    area, radius = area_and_radius(outline.corners(parameters))
    causes = causes_of(outline, parameters, radius, loading)
    to_pad = scales_of(outline, handedness, parameters, radius)
    bias = share * (causes @ np.array(error[:-1]))
    deviation = share * spread_at(area) * (EDGE_FACTOR if at_edge else 1.0) * np.array(error.deviation)
    least = np.concatenate(([LEAST_PLACE] * 2, [LEAST_ANGLE] * bool(outline.symmetry),
                            [LEAST_LENGTH] * len(outline.dimensions)))
    systematic = (to_pad * deviation ** 2) @ to_pad.T
    systematic.reshape(-1)[::len(least) + 1] += least ** 2
    found = parameters - to_pad @ bias
    count = len(outline.dimensions)
    found[-count:] = np.maximum(found[-count:], LEAST_DIMENSION)
    return found, covariance + systematic


def errors_of(shape: Shape, loading: Loading) -> ModelError:
    """Return the model errors for a shape and a kind of object."""
    return PUNCH_ERRORS[shape] if loading.is_punch else DOME_ERRORS[loading.indenter]


def share_of(loading: Loading) -> float:
    """Return the share of the model errors that applies, which is 0 for a punch with an even pressure."""
    return min(max(loading.peak, 0.0), MOST_PEAK) if loading.is_punch else 1.0


def causes_of(outline: Outline, parameters: np.ndarray, radius: float, loading: Loading) -> np.ndarray:
    """Return the factors by which the terms of a ModelError are multiplied, (5,)."""
    _, _, dimensions = outline.split(parameters)
    peak = min(max(loading.peak - 1, -1.0), MOST_DOME_PEAK)
    radius = max(radius, LEAST_RADIUS)
    depth = min(loading.depth, MOST_DEPTH)
    return np.array((1, 1 / radius, np.log(dimensions[0] / dimensions[-1]), depth / radius, peak))


def spread_at(area: float) -> float:
    """Return the factor for the standard deviation of a contact with this ``area`` [taxels]."""
    return 1 + (FEW_TAXELS / max(area, LEAST_AREA)) ** 2


def scales_of(outline: Outline, handedness: int, parameters: np.ndarray, radius: float) -> np.ndarray:
    """Return the matrix, (p, p), that converts relative errors in the shape's frame to errors of the parameters."""
    _, angle, dimensions = outline.split(parameters)
    turned = [float(handedness)] if outline.symmetry else []  # the angle of a mirrored shape turns the other way
    scales = np.diag((radius, radius, *turned, *dimensions))
    scales[:2, :2] = radius * rotation(angle).T
    scales[:2, 1] *= handedness
    return scales


def area_and_radius(corners: np.ndarray) -> tuple[float, float]:
    """Return the area of a polygon, and 2 area / perimeter.

    Except for rectangles, 2 area / perimeter is the radius of the inscribed circle.
    """
    following = np.concatenate((corners[1:], corners[:1]))
    area = abs((corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]).sum()) / 2
    return float(area), float(2 * area / np.hypot(*(following - corners).T).sum())


SMALLEST_NOISE = 0.002  #: Smallest noise that a fit assumes for a taxel value [fraction of level].
FELT_RIM = 0.05         #: The noise is estimated from taxels whose `Prediction.rim` is at most this.
RIM_COUNT = 20          #: Weight of the tabulated rim noise, expressed as a number of taxels.
OUTLIER_SPREADS = 3.0   #: A taxel whose residual exceeds this many standard deviations loses weight (Huber).
TO_DEVIATION = 1.4826   #: Ratio of the standard deviation of a normal distribution to its median absolute deviation.
PATTERN_NOISE = 0.02    #: Smallest variance that a fit assumes for an on/off taxel.


class NoiseScale(NamedTuple):
    """Noise of the taxels under one shape, and scale factors for the covariance of its fits."""

    #: noise of a taxel on the outline due to simplifications in the model [fraction of level]
    rim: float
    pressure: float  #: scale factor of the covariance for pressures
    on_off: float    #: scale factor of the covariance for on/off patterns
    at_edge: float   #: additional factor for pressures at the pad's edge, because the part beyond the edge is a guess


#: The factors were measured with `bench/bench_pose.py --calibrate --patterns 50` on the training seeds, with 1200 fits
#: per factor. The rim noise was chosen so that clean and noisy frames need nearly the same factor. The factors for the
#: pad's edge were measured on punches simulated with the training seeds, with up to a third of the punch beyond the
#: edge (bench/pose_mechanics.py).
NOISE_SCALES = {
    Shape.CIRCLE: NoiseScale(0.018, 1.00, 0.25, 1.5),
    Shape.SQUARE: NoiseScale(0.020, 1.01, 0.49, 1.5),
    Shape.RECTANGLE: NoiseScale(0.021, 1.06, 0.46, 70),
    Shape.RIGHT_TRIANGLE: NoiseScale(0.030, 0.96, 0.45, 60),
    Shape.ISOSCELES_TRIANGLE: NoiseScale(0.024, 1.16, 0.47, 100),
}


def weights_after(shape: Shape, evidence: Evidence, fitted: np.ndarray, at_rim: np.ndarray) -> np.ndarray:
    """Return the weight of each taxel value after a first fit.

    The weight is 1 / variance, reduced for outliers. Unused taxels have the weight 0.

    Parameters
    ----------
    shape : Shape
        Shape of the outline.
    evidence : Evidence
        Taxels to which the outline was fitted.
    fitted : np.ndarray
        Taxel values that the first fit predicts, (taxels,).
    at_rim : np.ndarray
        Sensitivity of each value to the position of the outline (`Prediction.rim`), (taxels,).
    """
    if evidence.on_off:
        return evidence.used / (at_rim + PATTERN_NOISE)
    residual, is_rim = np.abs(evidence.values - fitted), at_rim > FELT_RIM
    flat = residual[evidence.used & ~is_rim]
    noise = max(SMALLEST_NOISE, TO_DEVIATION * upper_median(flat)) ** 2
    rim = residual[evidence.used & is_rim]
    own = max(rim @ rim - noise * rim.size, 0.0)
    rim_noise = (RIM_COUNT * NOISE_SCALES[shape].rim**2 + own) / (RIM_COUNT + rim.size)
    variance = noise + rim_noise * np.minimum(at_rim, 1)
    trusted = np.minimum(1, OUTLIER_SPREADS * np.sqrt(variance) / np.maximum(residual, 1e-12))
    return evidence.used / variance * trusted


def covariance_scale(shape: Shape, evidence: Evidence) -> float:
    """Return the covariance's scale factor, with which 95 % regions contained 95 % of the training contacts."""
    of_shape = NOISE_SCALES[shape]
    scale = of_shape.on_off if evidence.on_off else of_shape.pressure
    return scale * (of_shape.at_edge if evidence.at_edge and not evidence.on_off else 1.0)
