"""Section 3: Λ, the smallest eigenvalue of A, of many patterns at once.

All matrices are laid along the diagonal of one banded matrix, and LAPACK's banded Cholesky solves them
together: inverse iteration from a positive vector (which the ground state of an M-matrix is never
orthogonal to), with each matrix shifted to just below its own Rayleigh quotient. An iterate x with
residual r = A x - θ x has an eigenvalue within ‖r‖/‖x‖ of θ; it is accepted at 2e-10 θ. What does not
get there (nearly equal eigenvalues of weakly joined parts) goes to a dense solver.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from tactile_node.helmholtz.operators import WEIGHTS, Stencil
from tactile_node.helmholtz.taxel_list import TaxelList

TOLERANCE = 2e-10  #: of the residual, relative to the eigenvalue
ROUNDS = 6  #: factorisations, each with a better shift
SOLVES = 3  #: inverse iterations a factorisation
COLUMNS = 20_000  #: taxels treated together, to stay within the processor's cache


def smallest_eigenvalues(taxels: TaxelList, stencil: Stencil) -> np.ndarray:
    """Return Λ of each of the K patterns of ``taxels``, shape (K,); NaN for an empty one."""
    found = np.full(len(taxels.counts), np.nan)
    matrices = _banded(taxels, stencil)
    filled = np.flatnonzero(taxels.counts)
    for part in _parts(taxels.counts[filled]):
        found[filled[part]] = _solve(_selected(matrices, filled[part]))
    return found


class Banded(NamedTuple):
    """Matrices side by side on one diagonal, as LAPACK's lower band storage, transposed.

    ``band`` has shape (total, bandwidth + 1): row j holds A(j, j), A(j+1, j), ...; matrix k has the rows
    ``start[k]:start[k + 1]``.
    """

    band: np.ndarray
    start: np.ndarray

    @property
    def sizes(self) -> np.ndarray:
        return np.diff(self.start)


def _banded(taxels: TaxelList, stencil: Stencil) -> Banded:
    weights = WEIGHTS[stencil]
    later, earlier, is_edge = taxels.neighbour_pairs()
    if not weights.corner:
        later, earlier, is_edge = later[is_edge], earlier[is_edge], True
    width = int((later - earlier).max(initial=0)) + 1
    band = np.zeros((taxels.total, width))
    band[:, 0] = weights.centre / weights.denominator
    band.reshape(-1)[earlier * width + (later - earlier)] = np.where(
        is_edge, weights.edge / weights.denominator, weights.corner / weights.denominator)
    return Banded(band, taxels.start)


def _parts(sizes: np.ndarray) -> list[slice]:
    """Cut a row of matrices into slices of about COLUMNS columns each."""
    cuts = np.flatnonzero(np.diff(np.cumsum(sizes) // COLUMNS, prepend=-1))
    return [slice(a, b) for a, b in zip(cuts, [*cuts[1:], len(sizes)])]


def _selected(matrices: Banded, chosen: np.ndarray) -> Banded:
    keep = np.zeros(len(matrices.sizes), bool)
    keep[chosen] = True
    band = matrices.band[np.repeat(keep, matrices.sizes)]
    return Banded(band, np.concatenate(([0], np.cumsum(matrices.sizes[keep]))))


def _solve(matrices: Banded) -> np.ndarray:
    """Smallest eigenvalue of each matrix; none is empty."""
    found = np.full(len(matrices.sizes), np.nan)
    pending, shift, x = np.arange(len(found)), np.zeros(len(found)), np.ones(len(matrices.band))
    for _ in range(ROUNDS):
        part = _selected(matrices, pending)
        factor, failed = _factorise(part, shift)
        if failed is None:
            value, residual, x = _iterate(factor, part, shift, x)
            done = residual <= TOLERANCE * value
            found[pending[done]] = value[done]
            keep, shift = ~done, value - 1.2 * residual
        else:  # the shift was above its smallest eigenvalue: leave that matrix to the dense solver
            keep = np.arange(len(pending)) != failed
        x, pending, shift = x[np.repeat(keep, part.sizes)], pending[keep], shift[keep]
        if not len(pending):
            break
    for left in np.flatnonzero(np.isnan(found)):
        found[left] = _dense(matrices.band[matrices.start[left]:matrices.start[left + 1]])
    return found


def _factorise(part: Banded, shift: np.ndarray) -> tuple[np.ndarray, int | None]:
    """Cholesky factor of A - shift, or the first matrix that is not positive definite."""
    band = part.band.copy()
    band[:, 0] -= np.repeat(shift, part.sizes)
    factor, info = lapack.dpbtrf(band.T, lower=1, overwrite_ab=1)
    return factor, None if info == 0 else int(np.searchsorted(part.start, info - 1, 'right')) - 1


def _iterate(factor: np.ndarray, part: Banded, shift: np.ndarray, x: np.ndarray):
    """Return Rayleigh quotient, residual norm (both of shape (K,)) and iterate after SOLVES solves."""
    for _ in range(SOLVES):
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
