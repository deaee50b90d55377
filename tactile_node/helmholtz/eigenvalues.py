"""Section 3: Λ, the smallest eigenvalue of A, of many patterns at once.

All matrices are laid along the diagonal of one banded matrix, and LAPACK's banded Cholesky solves them
together: inverse iteration from a positive vector (which the ground state of an M-matrix is never
orthogonal to), with each matrix shifted to just below its own Rayleigh quotient. An iterate x with
residual r = A x - θ x has an eigenvalue within ‖r‖/‖x‖ of θ; it is accepted at 2e-10 θ. What does not
get there in time (nearly equal eigenvalues of weakly joined parts) goes to a dense solver.
"""

from typing import NamedTuple

import numpy as np
from scipy import ndimage
from scipy.linalg import lapack

from tactile_node.helmholtz.operators import WEIGHTS, Stencil
from tactile_node.helmholtz.taxel_list import TaxelList

TOLERANCE = 2e-10  #: of the residual, relative to the eigenvalue
SOLVES = (3, 5, 3, 2, 2, 2, 2)  #: inverse iterations with each shift; the last is the last attempt
MARGIN = 1.2  #: of the shift below the Rayleigh quotient, in residuals
GUESS = 0.7 * np.pi * 2.404825557695773 ** 2  #: first shift times area; a disc has the least (Faber-Krahn)
COLUMNS = 20_000  #: taxels treated together, to stay within the processor's cache

_PLANE = np.zeros((3, 3, 3), bool)  # nothing joins one pattern to the next
_NEIGHBOURS = {Stencil.FIVE: _PLANE.copy(), Stencil.NINE: _PLANE.copy()}
_NEIGHBOURS[Stencil.FIVE][1] = [[0, 1, 0], [1, 1, 1], [0, 1, 0]]
_NEIGHBOURS[Stencil.NINE][1] = True


class Problem(NamedTuple):
    """The matrices A of all patterns of a list by one stencil."""

    taxels: TaxelList
    stencil: Stencil


def smallest_eigenvalues(problems: list[Problem]) -> list[np.ndarray]:
    """Return Λ of each of the patterns of each problem, shape (K,); NaN for an empty one.

    Problems of like size are solved fastest together.
    """
    parts = [_connected(problem) for problem in problems]
    matrices = _banded(parts)
    values = np.concatenate([_solve(matrices.part(chunk)) for chunk in _chunks(matrices.sizes)] or [np.zeros(0)])
    cuts = np.cumsum([len(part.sizes) for part in parts])[:-1]
    return [_least(part, problem.taxels, found)
            for part, problem, found in zip(parts, problems, np.split(values, cuts))]


class Parts(NamedTuple):
    """The connected parts of all patterns of a problem: A falls into one block for each of them."""

    sizes: np.ndarray     #: taxels of each part
    pattern: np.ndarray   #: which pattern each part belongs to, rising
    column: np.ndarray    #: of each entry of A below the diagonal, taxels numbered part by part
    distance: np.ndarray  #: of each entry from the diagonal
    values: np.ndarray    #: the entries
    diagonal: float


def _connected(problem: Problem) -> Parts:
    taxels, weights = problem.taxels, WEIGHTS[problem.stencil]
    active = np.zeros(taxels.shape, bool)
    active.reshape(-1)[taxels.site] = True
    label = ndimage.label(active, _NEIGHBOURS[problem.stencil])[0].reshape(-1)[taxels.site]
    order = np.argsort(label, kind='stable')
    sizes = np.bincount(label)[1:] if len(label) else np.zeros(0, int)
    place = np.empty(taxels.total, np.intp)
    place[order] = np.arange(taxels.total)
    later, earlier, is_edge = taxels.neighbour_pairs()
    if not weights.corner:
        later, earlier, is_edge = later[is_edge], earlier[is_edge], True
    values = np.where(is_edge, weights.edge / weights.denominator, weights.corner / weights.denominator)
    column = place[earlier]
    first = order[np.cumsum(sizes) - sizes]
    pattern = np.searchsorted(taxels.start, first, 'right') - 1
    return Parts(sizes, pattern, column, place[later] - column, values, weights.centre / weights.denominator)


def _least(part: Parts, taxels: TaxelList, values: np.ndarray) -> np.ndarray:
    """The smallest of the parts' eigenvalues of each pattern."""
    least = np.full(len(taxels.counts), np.inf)
    np.minimum.at(least, part.pattern, values)
    return np.where(taxels.counts > 0, least, np.nan)


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


def _banded(parts: list[Parts]) -> Banded:
    sizes = np.concatenate([part.sizes for part in parts])
    width = max(int(part.distance.max(initial=0)) for part in parts) + 1
    band, first = np.zeros((int(sizes.sum()), width)), 0
    for part in parts:
        rows = band[first:first + int(part.sizes.sum())]
        rows[:, 0] = part.diagonal
        rows.reshape(-1)[part.column * width + part.distance] = part.values
        first += len(rows)
    return Banded.of(band, sizes)


def _chunks(sizes: np.ndarray) -> list[slice]:
    """Cut a row of matrices into slices of about COLUMNS columns each."""
    cuts = np.flatnonzero(np.diff(np.cumsum(sizes) // COLUMNS, prepend=-1))
    return [slice(a, b) for a, b in zip(cuts, [*cuts[1:], len(sizes)])]


def _solve(matrices: Banded) -> np.ndarray:
    """Smallest eigenvalue of each matrix; none is empty."""
    found = np.full(len(matrices.sizes), np.nan)
    left, pending = matrices, np.arange(len(found))
    shift = np.where(matrices.sizes < 9, 0, GUESS / (np.sqrt(matrices.sizes) + 1) ** 2)
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
    for _ in range(solves - 1):
        x, _ = lapack.dpbtrs(factor, x, lower=1)
    previous = x * np.repeat(1 / _norms(x, part), part.sizes)
    x, _ = lapack.dpbtrs(factor, previous, lower=1)
    scale = 1 / _norms(x, part)
    scales = np.repeat(scale, part.sizes)
    x *= scales
    previous *= scales
    # (A - shift) x = previous, scaled: neither the quotient nor the residual needs a product with A.
    excess = np.add.reduceat(x * previous, part.start[:-1])
    return shift + excess, _norms(previous - np.repeat(excess, part.sizes) * x, part), x


def _norms(x: np.ndarray, part: Banded) -> np.ndarray:
    return np.sqrt(np.add.reduceat(x * x, part.start[:-1]))


def _dense(band: np.ndarray) -> float:
    size, width = band.shape
    full = np.zeros((size, size))
    for offset in range(min(width, size)):
        column = np.arange(size - offset)
        full[column + offset, column] = band[column, offset]
    return float(np.linalg.eigvalsh(full, UPLO='L')[0])
