"""Section 3: Λ, the smallest eigenvalue of A, of many patterns at once.

All matrices are laid along the diagonal of one banded matrix, and LAPACK's banded Cholesky solves them
together: inverse iteration from a positive vector (which the ground state of an M-matrix is never
orthogonal to), with each matrix shifted to just below its own Rayleigh quotient. An iterate x with
residual r = A x - θ x has an eigenvalue within ‖r‖/‖x‖ of θ; it is accepted at 2e-10 θ. What does not
get there in time (nearly equal eigenvalues of weakly joined parts) goes to a dense solver.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from tactile_node.helmholtz.operators import WEIGHTS, Stencil
from tactile_node.helmholtz.taxel_list import TaxelList

TOLERANCE = 2e-10  #: of the residual, relative to the eigenvalue
SOLVES = (4, 4, 3, 2, 2, 2, 2)  #: inverse iterations with each shift; the last is the last attempt
MARGIN = 1.2  #: of the shift below the Rayleigh quotient, in residuals
COLUMNS = 20_000  #: taxels treated together, to stay within the processor's cache


class Problem(NamedTuple):
    """The matrices A of all patterns of a list by one stencil."""

    taxels: TaxelList
    stencil: Stencil


def smallest_eigenvalues(problems: list[Problem]) -> list[np.ndarray]:
    """Return Λ of each of the patterns of each problem, shape (K,); NaN for an empty one.

    Problems of like size are solved fastest together.
    """
    sizes = np.concatenate([problem.taxels.counts for problem in problems])
    found = np.full(len(sizes), np.nan)
    matrices, filled = _banded(problems, sizes[sizes > 0]), np.flatnonzero(sizes)
    for part in _parts(matrices.sizes):
        found[filled[part]] = _solve(matrices.part(part))
    return np.split(found, np.cumsum([len(problem.taxels.counts) for problem in problems])[:-1])


class Banded(NamedTuple):
    """Matrices side by side on one diagonal, as LAPACK's lower band storage, transposed.

    ``band`` has shape (total, bandwidth + 1): row j holds A(j, j), A(j+1, j), ...; matrix k has the rows
    ``start[k]:start[k + 1]``, ``sizes[k]`` of them.
    """

    band: np.ndarray
    sizes: np.ndarray
    start: np.ndarray

    @classmethod
    def of(cls, band: np.ndarray, sizes: np.ndarray) -> 'Banded':
        return cls(band, sizes, np.concatenate(([0], np.cumsum(sizes))))

    def part(self, chosen: slice) -> 'Banded':
        start = self.start[:-1][chosen]
        sizes = self.sizes[chosen]
        return Banded.of(self.band[start[0]:start[-1] + sizes[-1]], sizes)

    def where(self, keep: np.ndarray) -> 'Banded':
        return self if keep.all() else Banded.of(self.band[np.repeat(keep, self.sizes)], self.sizes[keep])


def _banded(problems: list[Problem], sizes: np.ndarray) -> Banded:
    entries = [_entries(problem) for problem in problems]
    width = max(int(distance.max(initial=0)) for _, distance, _ in entries) + 1
    band = np.zeros((int(sizes.sum()), width))
    first = 0
    for (taxels, stencil), (column, distance, values) in zip(problems, entries):
        rows = band[first:first + taxels.total]
        rows[:, 0] = WEIGHTS[stencil].centre / WEIGHTS[stencil].denominator
        rows.reshape(-1)[column * width + distance] = values
        first += taxels.total
    return Banded.of(band, sizes)


def _entries(problem: Problem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Column, distance from the diagonal, and value of the entries below it."""
    weights = WEIGHTS[problem.stencil]
    later, earlier, is_edge = problem.taxels.neighbour_pairs()
    if not weights.corner:
        later, earlier, is_edge = later[is_edge], earlier[is_edge], True
    values = np.where(is_edge, weights.edge / weights.denominator, weights.corner / weights.denominator)
    return earlier, later - earlier, values


def _parts(sizes: np.ndarray) -> list[slice]:
    """Cut a row of matrices into slices of about COLUMNS columns each."""
    cuts = np.flatnonzero(np.diff(np.cumsum(sizes) // COLUMNS, prepend=-1))
    return [slice(a, b) for a, b in zip(cuts, [*cuts[1:], len(sizes)])]


def _solve(matrices: Banded) -> np.ndarray:
    """Smallest eigenvalue of each matrix; none is empty."""
    found = np.full(len(matrices.sizes), np.nan)
    left, pending, shift = matrices, np.arange(len(found)), np.zeros(len(found))
    x = np.ones(len(matrices.band))
    for solves in SOLVES:
        factor, shift = _factorise(left, shift)
        value, residual, x = _iterate(factor, left, shift, x, solves)
        keep = residual > TOLERANCE * value
        found[pending[~keep]] = value[~keep]
        if not keep.any():
            break
        x, pending, left = x[np.repeat(keep, left.sizes)], pending[keep], left.where(keep)
        shift = (value - MARGIN * residual)[keep]
    for hard in np.flatnonzero(np.isnan(found)):
        found[hard] = _dense(matrices.part(slice(hard, hard + 1)).band)
    return found


def _factorise(part: Banded, shift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cholesky factor of A - shift, and the shift: 0 where that asked for exceeds the smallest eigenvalue."""
    while True:
        band = part.band.copy()
        band[:, 0] -= np.repeat(shift, part.sizes)
        factor, failed = lapack.dpbtrf(band.T, lower=1, overwrite_ab=1)
        if failed == 0:
            return factor, shift
        shift = shift.copy()
        shift[np.searchsorted(part.start, failed - 1, 'right') - 1] = 0.0


def _iterate(factor: np.ndarray, part: Banded, shift: np.ndarray, x: np.ndarray, solves: int):
    """Return Rayleigh quotient, residual norm (both of shape (K,)) and iterate after some solves."""
    for _ in range(solves):
        previous = x
        solution, _ = lapack.dpbtrs(factor, x, lower=1)
        scale = 1 / np.sqrt(np.add.reduceat(solution * solution, part.start[:-1]))
        x = solution * np.repeat(scale, part.sizes)
    excess = scale * np.add.reduceat(x * previous, part.start[:-1])  # Rayleigh quotient - shift
    # (A - shift) x = scale * previous, so the residual needs no product with A.
    residual = np.repeat(scale, part.sizes) * previous - np.repeat(excess, part.sizes) * x
    return shift + excess, np.sqrt(np.add.reduceat(residual * residual, part.start[:-1])), x


def _dense(band: np.ndarray) -> float:
    size, width = band.shape
    full = np.zeros((size, size))
    for offset in range(min(width, size)):
        column = np.arange(size - offset)
        full[column + offset, column] = band[column, offset]
    return float(np.linalg.eigvalsh(full, UPLO='L')[0])
