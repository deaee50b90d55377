"""Rates with intervals, calibration, rejection."""

from typing import NamedTuple

import numpy as np

Z = 1.959964  #: 95 %


class Rate(NamedTuple):
    """``right`` of ``count`` and its 95 % Wilson interval."""

    right: int
    count: int

    @property
    def value(self) -> float:
        return self.right / self.count

    @property
    def interval(self) -> tuple[float, float]:
        """E. B. Wilson, J. Am. Stat. Assoc. 22 (1927)."""
        n, p = self.count, self.right / self.count
        middle = (p + Z * Z / (2 * n)) / (1 + Z * Z / n)
        half = Z / (1 + Z * Z / n) * np.sqrt(p * (1 - p) / n + Z * Z / (4 * n * n))
        low, high = max(middle - half, 0.0), min(middle + half, 1.0)
        return 0.0 if self.right == 0 else low, 1.0 if self.right == n else high  # exact, where rounding is not

    def __str__(self) -> str:
        low, high = self.interval
        return f'{100 * self.value:.2f} ({100 * low:.2f}-{100 * high:.2f})'


def calibration_error(confidence: np.ndarray, right: np.ndarray, bins: int = 15) -> float:
    """Expected calibration error: mean distance of confidence and rate over ``bins`` of equal width."""
    which = np.minimum((confidence * bins).astype(int), bins - 1)
    gaps = [abs(confidence[which == b].mean() - right[which == b].mean()) * (which == b).sum()
            for b in range(bins) if (which == b).any()]
    return float(sum(gaps) / len(confidence))
