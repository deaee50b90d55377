"""Compute rates with intervals, and the calibration error."""

import numpy as np

from tactile_node.learning import teach


class PercentRate(teach.Rate):
    """A rate that the recognition tables show in per cent, without the sign."""

    def __str__(self) -> str:
        low, high = self.interval
        return f'{100 * self.value:.2f} ({100 * low:.2f}-{100 * high:.2f})'


def rate_of(right: np.ndarray) -> teach.Rate:
    """Return the rate of True values in the array ``right``."""
    return teach.Rate(int(np.count_nonzero(right)), len(right))


def calibration_error(confidence: np.ndarray, right: np.ndarray, bins: int = 15) -> float:
    """Return the expected calibration error, which is the mean gap between confidence and rate in equal ``bins``."""
    which = np.minimum((confidence * bins).astype(int), bins - 1)
    gaps = [abs(confidence[which == b].mean() - right[which == b].mean()) * (which == b).sum()
            for b in range(bins) if (which == b).any()]
    return float(sum(gaps) / len(confidence))
