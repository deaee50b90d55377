"""A share of a count with its 95 % interval."""

from typing import NamedTuple


class Rate(NamedTuple):
    """``right`` ones of ``total``."""

    right: int
    total: int

    @property
    def value(self) -> float:
        """NaN of nothing."""
        return self.right / self.total if self.total else float('nan')

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval by E. B. Wilson, J. Am. Stat. Assoc. 22 (1927).

        >>> [round(end, 3) for end in Rate(29, 30).interval]
        [0.833, 0.994]
        """
        from scipy.stats import binomtest  # slow to import

        if not self.total:
            return 0.0, 1.0
        low, high = binomtest(self.right, self.total).proportion_ci(method='wilson')
        return float(low), float(high)

    def __str__(self) -> str:
        low, high = self.interval
        return f'{100 * self.value:.1f} % ({100 * low:.1f}-{100 * high:.1f})'
