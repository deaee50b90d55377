"""Factorise and solve many banded matrices together with LAPACK."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack


class Banded(NamedTuple):
    """Matrices side by side on one diagonal, in LAPACK's lower band storage, transposed.

    The array ``band`` has the shape (total, bandwidth + 1). Row j holds A(j, j), A(j+1, j), ... Matrix k has
    ``sizes[k]`` rows, which are ``start[k]:start[k + 1]``. A Cholesky factor is stored in the same way.
    """

    band: np.ndarray
    sizes: np.ndarray
    start: np.ndarray

    @classmethod
    def of(cls, band: np.ndarray, sizes: np.ndarray) -> 'Banded':
        return cls(band, sizes, np.concatenate(([0], np.cumsum(sizes))))

    def part(self, chosen: slice) -> 'Banded':
        return Banded.of(self.band[self.rows(chosen)], self.sizes[chosen])

    def where(self, keep: np.ndarray) -> 'Banded':
        return self if keep.all() else Banded.of(self.band[np.repeat(keep, self.sizes)], self.sizes[keep])

    def rows(self, chosen: slice) -> slice:
        """Return the rows of ``band`` that hold the ``chosen`` matrices."""
        first, last, _ = chosen.indices(len(self.sizes))
        return slice(self.start[first], self.start[last])

    def factorised(self, shift: np.ndarray, certain: np.ndarray) -> tuple['Banded', np.ndarray]:
        """Return the Cholesky factors of A - shift, and the shifts.

        Each returned shift is guaranteed to be below the smallest eigenvalue of its matrix. A given shift that is too
        high is halved or, if that is lower, set slightly below the known lower bound ``certain``.
        """
        while True:
            band = self.band.copy()
            band[:, 0] -= np.repeat(shift, self.sizes)
            factor, failed = lapack.dpbtrf(band.T, lower=1, overwrite_ab=1)
            if failed == 0:
                return Banded(factor.T, self.sizes, self.start), shift
            shift = shift.copy()
            wrong = np.searchsorted(self.start, failed - 1, 'right') - 1
            shift[wrong] = min(certain[wrong] * (1 - 1e-9), shift[wrong] / 2)

    def solved(self, right: np.ndarray) -> np.ndarray:
        """Return the solution x of L Lᵀ x = right. This object holds the factors L."""
        return lapack.dpbtrs(self.band.T, right, lower=1)[0]

    def norms(self, x: np.ndarray) -> np.ndarray:
        """Return the Euclidean norm of each matrix's share of the vector ``x``."""
        return np.sqrt(self.sums(x * x))

    def sums(self, x: np.ndarray) -> np.ndarray:
        """Return the sum of each matrix's share of the vector ``x``."""
        return np.add.reduceat(x, self.start[:-1])

    def least(self, x: np.ndarray) -> np.ndarray:
        """Return the smallest element of each matrix's share of the vector ``x``."""
        return np.minimum.reduceat(x, self.start[:-1])

    def spread(self, each: np.ndarray) -> np.ndarray:
        """Return one value per row, repeated from one value per matrix."""
        return np.repeat(each, self.sizes)

    def dense(self, index: int) -> np.ndarray:
        """Return matrix ``index`` as a dense array. Only the lower triangle of the dense array is set."""
        rows = self.band[self.start[index]:self.start[index + 1]]
        full = np.zeros((len(rows), len(rows)))
        for offset in range(min(rows.shape[1], len(rows))):
            column = np.arange(len(rows) - offset)
            full[column + offset, column] = rows[column, offset]
        return full
