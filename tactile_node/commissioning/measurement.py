"""Estimate quantities with their standard deviations from repeated measurements."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

#: Share of a normal distribution that lies within two standard deviations.
TWO_SIGMA = 0.9545


class Estimate(NamedTuple):
    """A value with its standard deviation, in the same unit. Both are NaN if the value is not known."""

    value: float
    deviation: float

    @property
    def is_known(self) -> bool:
        return math.isfinite(self.value) and math.isfinite(self.deviation)

    @property
    def upper(self) -> float:
        """Value plus two deviations."""
        return self.value + 2 * self.deviation

    def with_error(self, deviation: float) -> 'Estimate':
        """Return the same value with a further independent error."""
        return Estimate(self.value, math.hypot(self.deviation, deviation))

    def scaled(self, factor: float) -> 'Estimate':
        return Estimate(self.value * factor, self.deviation * abs(factor))


NOT_MEASURED = Estimate(math.nan, math.nan)


def mean_of(values: Sequence[float] | np.ndarray) -> Estimate:
    """Return the mean of repeated measurements.

    The standard deviation of the mean is widened for few repeats by Student's t-distribution, so that two deviations
    contain the true value as often as for a normal distribution. Two or more values are needed.
    """
    count = len(values)
    if count < 2:
        return NOT_MEASURED
    spread = float(np.std(values, ddof=1)) / math.sqrt(count)
    return Estimate(float(np.mean(values)), spread * _widening(count - 1))


def jackknife(estimate: Callable[[np.ndarray], np.ndarray], count: int, unknowns: int) -> list[Estimate]:
    """Return the numbers that ``estimate`` computes, with deviations from leaving out one measurement at a time.

    Unlike the residuals of a fit, the jackknife includes errors that many readings of one measurement share.

    Parameters
    ----------
    estimate : callable
        Function that takes the indices of the measurements to use, and returns the numbers, (N,).
    count : int
        Number of measurements.
    unknowns : int
        Number of unknowns in the fit, with which the deviation is widened as in `mean_of`.
    """
    whole = estimate(np.arange(count))
    if count <= unknowns:
        return [NOT_MEASURED] * len(whole)
    without = np.array([estimate(np.delete(np.arange(count), left_out)) for left_out in range(count)])
    deviations = np.sqrt((count - 1) * without.var(0)) * _widening(count - unknowns)
    return [Estimate(float(value), float(deviation)) for value, deviation in zip(whole, deviations)]


def line_through(x: np.ndarray, y: np.ndarray) -> tuple[Estimate, Estimate]:
    """Return the slope and the value at x = 0 of the straight line through three or more points.

    The deviations assume that the errors of ``y`` are independent.
    """
    count = len(x)
    if count < 3 or np.ptp(x) == 0:
        return NOT_MEASURED, NOT_MEASURED
    line, covariance = np.polyfit(x, y, 1, cov=True)
    slope, offset = (Estimate(float(value), float(deviation) * _widening(count - 2))
                     for value, deviation in zip(line, np.sqrt(np.diag(covariance))))
    return slope, offset


def _widening(freedom: int) -> float:
    """Return the factor between a normal distribution and Student's t with this many degrees of freedom."""
    return float(stdtrit(freedom, (1 + TWO_SIGMA) / 2)) / 2
