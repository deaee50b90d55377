"""What a fit assumes of the values: their noise, found from the fit's own residuals, and its calibration."""

from typing import NamedTuple

import numpy as np

from tactile_node.pose.evidence import Evidence
from tactile_node.pose.skin_model import Prediction
from tactile_node.shape.recognition import Shape

SMALLEST_NOISE = 0.002  #: of a value [fraction of level]: no skin is better
FELT = 0.05             #: taxels that feel less of the outline show the noise
RIM_COUNT = 20          #: weight of that assumption [taxels]
OUTLIER = 3.0           #: beyond so many standard deviations a taxel loses weight (Huber)
TO_DEVIATION = 1.4826   #: from the median of absolute normal values
PATTERN_NOISE = 0.02    #: least variance of an on/off taxel


class Calibration(NamedTuple):
    """Of one shape."""

    rim: float       #: of a taxel that feels the whole outline: what the model leaves out [fraction of level]
    pressure: float  #: factor of the covariance
    on_off: float    #: the same for on/off patterns, whose noise is only a picture of what is not known
    at_edge: float   #: a further factor of pressures at the pad's edge: what lies beyond is a guess


#: Factors found by `bench/bench_pose.py --calibrate --patterns 50` on training seeds (1200 fits each); rim
#: noise chosen there, so that clean frames and noisy ones ask for nearly the same factor. At the edge: by computed
#: punches of training seeds with up to a third beyond it (bench/pose_mechanics.py).
CALIBRATION = {
    Shape.CIRCLE: Calibration(0.018, 1.00, 0.25, 1.5),
    Shape.SQUARE: Calibration(0.020, 1.01, 0.49, 1.5),
    Shape.RECTANGLE: Calibration(0.021, 1.06, 0.46, 70),
    Shape.RIGHT_TRIANGLE: Calibration(0.030, 0.96, 0.45, 60),
    Shape.ISOSCELES_TRIANGLE: Calibration(0.024, 1.16, 0.47, 100),
}


def weights_after(shape: Shape, prediction: Prediction, evidence: Evidence) -> np.ndarray:
    """Return 1 / variance of each value given a first fit, 0 where not used, less for outliers."""
    if evidence.on_off:
        of_pattern: np.ndarray = evidence.used / (prediction.rim + PATTERN_NOISE)
        return of_pattern
    residual, at_rim = np.abs(evidence.values - prediction.values), prediction.rim > FELT
    flat = residual[evidence.used & ~at_rim]
    noise = max(SMALLEST_NOISE, TO_DEVIATION * float(np.partition(flat, flat.size // 2)[flat.size // 2])
                if flat.size else 0.0) ** 2
    rim = residual[evidence.used & at_rim]
    own = max(rim @ rim - noise * rim.size, 0.0)
    rim_noise = (RIM_COUNT * CALIBRATION[shape].rim**2 + own) / (RIM_COUNT + rim.size)
    variance = noise + rim_noise * np.minimum(prediction.rim, 1)
    trusted = np.minimum(1, OUTLIER * np.sqrt(variance) / np.maximum(residual, 1e-12))
    weights: np.ndarray = evidence.used / variance * trusted
    return weights


def covariance_scale(shape: Shape, evidence: Evidence) -> float:
    """Return the factor with which 95 % regions held 95 % of the training contacts."""
    calibration = CALIBRATION[shape]
    scale = calibration.on_off if evidence.on_off else calibration.pressure
    return scale * (calibration.at_edge if evidence.at_edge and not evidence.on_off else 1.0)
