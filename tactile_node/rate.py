"""A share of a count with its 95 % interval."""

from typing import NamedTuple

import numpy as np

Z = 1.959964  #: 95 %


class Rate(NamedTuple):
    """``right`` ones of ``total``."""

    right: int
    total: int

    @classmethod
    def of(cls, right: np.ndarray) -> 'Rate':
        """Return the rate of the True ones in ``right``, bool, shape (n,)."""
        return cls(int(np.count_nonzero(right)), len(right))

    @property
    def value(self) -> float:
        """NaN of nothing."""
        return self.right / self.total if self.total else float('nan')

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927).

        >>> [round(end, 3) for end in Rate(29, 30).interval]
        [0.833, 0.994]
        """
        if not self.total:
            return 0.0, 1.0
        n, p = self.total, self.value
        middle = (p + Z * Z / (2 * n)) / (1 + Z * Z / n)
        half = Z / (1 + Z * Z / n) * np.sqrt(p * (1 - p) / n + Z * Z / (4 * n * n))
        low, high = max(middle - half, 0.0), min(middle + half, 1.0)
        # Exact at the ends, where rounding is not.
        return 0.0 if self.right == 0 else float(low), 1.0 if self.right == n else float(high)

    @property
    def low(self) -> float:
        """Lower end of the interval."""
        return self.interval[0]

    @property
    def high(self) -> float:
        """Upper end of the interval."""
        return self.interval[1]

    def __str__(self) -> str:
        low, high = self.interval
        return f'{100 * self.value:.1f} % ({100 * low:.1f}-{100 * high:.1f})'
