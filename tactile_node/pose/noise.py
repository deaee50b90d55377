"""What a fit believes of the values: their noise, found from the fit's own residuals, and its calibration."""

import numpy as np

from tactile_node.pose.skin_model import Prediction
from tactile_node.shape.recognition import Shape

SMALLEST_NOISE = 0.002  #: of a value [fraction of level]: no skin is better
RIM_NOISE = 0.018       #: of a taxel at the rim beforehand: what the model leaves out
RIM_COUNT = 20          #: worth of that belief [taxels]
OUTLIER = 3.0           #: beyond so many standard deviations a taxel loses weight (Huber)
PATTERN_NOISE = 0.02    #: least variance of an on/off taxel


def weights_after(prediction: Prediction, values: np.ndarray, used: np.ndarray, on_off: bool) -> np.ndarray:
    """Return 1 / variance of each value given a first fit, 0 where not ``used``, less for outliers."""
    if on_off:
        return used / (prediction.rim + PATTERN_NOISE)
    residual = np.abs(values - prediction.values)
    at_rim = prediction.rim > 1e-6
    flat = residual[used & ~at_rim]
    noise = max(SMALLEST_NOISE, 1.4826 * float(np.partition(flat, flat.size // 2)[flat.size // 2]) if flat.size else 0.0) ** 2
    rim = residual[used & at_rim]
    own = max(rim @ rim - noise * rim.size, 0.0)
    rim_noise = (RIM_COUNT * RIM_NOISE**2 + own) / (RIM_COUNT + rim.size)
    variance = noise + rim_noise * at_rim
    return used / variance * np.minimum(1, OUTLIER * np.sqrt(variance) / np.maximum(residual, 1e-12))


def covariance_scale(shape: Shape, on_off: bool) -> float:
    return 1.0
