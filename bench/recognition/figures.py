"""Compute rates with intervals, the calibration error, and a test of two rates."""

import numpy as np
from scipy.stats import norm

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


def p_value_behind(ours: np.ndarray, other: np.ndarray, margin: float) -> float:
    """Return the p-value of the hypothesis that ``ours`` is at most ``margin`` worse than ``other``.

    A small p-value shows that ``ours`` is worse by more than ``margin``. The function applies the score test for paired
    proportions from Tango, Statistics in Medicine 17, 891 (1998).

    Parameters
    ----------
    ours, other : np.ndarray
        Arrays of bool, True for each right answer, over the same patterns.
    margin : float
        Allowed difference of the rates.

    Examples
    --------
    >>> ours, other = np.arange(1000) >= 40, np.full(1000, True)
    >>> p_value_behind(ours, other, 0.015) < 1e-3, p_value_behind(ours, ours, 0.015) > 0.99
    (True, True)
    """
    n, won, lost = len(ours), int((ours & ~other).sum()), int((~ours & other).sum())
    a, b = 2 * n, -(won + lost) - (2 * n - won + lost) * margin
    # share of lost patterns if the difference equals the margin
    share = (np.sqrt(b * b - 4 * a * lost * margin * (1 + margin)) - b) / (2 * a)
    variance = n * (2 * share - margin * (1 + margin))
    return float(norm.cdf((won - lost + n * margin) / np.sqrt(variance)))
