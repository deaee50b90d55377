"""Compute Λ, the smallest eigenvalue of A (section 3 of the paper), for many patterns at once.

The connected parts of all patterns lie along the diagonal of one banded matrix. The module solves all parts together by
inverse iteration from a positive vector. In an M-matrix, the vector stays positive, so the iteration finds the ground
state. Each round gives certain bounds for every Λ:

- The Rayleigh quotient θ of the iterate is an upper bound.

- If (A - s) x = x' with x, x' > 0, then Λ >= s + min x'_i / x_i (Collatz-Wielandt). Any s for which A - s has a
  Cholesky factor is also a lower bound.

For an iterate x with ‖x‖ = 1, an eigenvalue differs from θ by at most ‖A x - θ x‖. The iterate is accepted if this
distance is at most 2e-10 θ. Otherwise, the next round uses a shift just below θ. If the caller requests only the
extremes over the rotations, patterns that these bounds exclude as extremes are dropped, most of them after the first
round. Parts that do not converge in time are solved by a dense solver. Such parts consist of weakly joined pieces with
nearly equal eigenvalues.
"""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.helmholtz.banded import Banded
from tactile_node.helmholtz.taxel_list import WEIGHTS, Stencil, TaxelList

RESIDUAL_TOLERANCE = 2e-10            #: Largest accepted residual, relative to the eigenvalue.
ROUND_SOLVES = (3, 4, 4, 3, 2, 2, 2)  #: Number of inverse iterations in each round.
SHIFT_MARGIN = 1.2                    #: Distance of the shift below the Rayleigh quotient [residuals].

#: First shift times area. A disc has the smallest eigenvalue of all shapes with the same area (Faber-Krahn).
FIRST_SHIFT = 0.7 * np.pi * 2.404825557695773 ** 2
SHIFT_BELOW = 0.02     #: Distance of the first shift below the smallest row sum, which itself is a lower bound.

#: Number of taxels processed together. The data for this many taxels fit into the processor's cache.
CHUNK_COLUMNS = 5_000

_NEIGHBOURS = {Stencil.FIVE: ndimage.generate_binary_structure(2, 1),
               Stencil.NINE: ndimage.generate_binary_structure(2, 2)}


def smallest_eigenvalues(problems: list[tuple[TaxelList, Stencil]],
                         extremes_from: int | None = None) -> list[np.ndarray]:
    """Return the smallest eigenvalue Λ of each pattern.

    Parameters
    ----------
    problems : list of (TaxelList, Stencil)
        Lists of patterns, each with the stencil for its patterns.
    extremes_from : int or None
        Index from which only the patterns with the smallest and the greatest Λ are wanted; None if all are wanted.

    Returns
    -------
    list of np.ndarray
        Λ of the patterns of each list, (K,). The value is NaN for an empty pattern, and for a pattern from
        ``extremes_from`` onwards whose Λ is neither the smallest nor the greatest.
    """
    parts = [_connected(taxels, stencil) for taxels, stencil in problems]
    counts = [len(taxels.counts) for taxels, _ in problems]
    first = np.cumsum([0, *counts])
    owner = np.concatenate([part.pattern + offset for part, offset in zip(parts, first)])
    # number of the contest for extremes in which each pattern takes part; -1 for none
    contest = np.concatenate([np.where(np.arange(count) < (count if extremes_from is None else extremes_from), -1, i)
                              for i, count in enumerate(counts)])
    some, owner = np.unique(owner, return_inverse=True)
    found = np.full(first[-1], np.nan)
    found[some] = _solve(_banded(parts), np.concatenate([part.least for part in parts]), owner, contest[some])
    return np.split(found, first[1:-1])


class Parts(NamedTuple):
    """The connected parts of all patterns in a list. The matrix A has one block for each part."""

    sizes: np.ndarray     #: number of taxels of each part
    pattern: np.ndarray   #: index of the pattern to which each part belongs, in ascending order
    least: np.ndarray     #: smallest row sum of each part, which is a lower bound of its Λ
    column: np.ndarray    #: column of each entry of A below the diagonal, with taxels numbered part by part
    distance: np.ndarray  #: distance of each entry from the diagonal
    values: np.ndarray    #: the entries
    diagonal: float


def _connected(taxels: TaxelList, stencil: Stencil) -> Parts:
    weights = WEIGHTS[stencil]
    active = np.zeros(taxels.shape, bool)
    active.reshape(-1)[taxels.site] = True
    # The patterns are stacked vertically, and the ring around each pattern keeps them apart.
    stacked = active.reshape(-1, taxels.shape[2])
    label = ndimage.label(stacked, _NEIGHBOURS[stencil])[0].reshape(-1)[taxels.site]
    order = np.argsort(label, kind='stable')
    sizes = np.bincount(label, minlength=1)[1:]
    start = np.cumsum(sizes) - sizes
    place = np.empty(taxels.total, np.intp)
    place[order] = np.arange(taxels.total)
    later, earlier, is_edge = taxels.neighbour_pairs()
    if not weights.corner:
        later = later[is_edge]
        earlier = earlier[is_edge]
        is_edge = np.ones(len(later), bool)
    values = np.where(is_edge, weights.edge / weights.denominator, weights.corner / weights.denominator)
    column = place[earlier]
    pattern = np.searchsorted(taxels.start, order[start], 'right') - 1
    sums = taxels.row_sums(weights)[order] / weights.denominator
    least = np.minimum.reduceat(sums, start) if len(sizes) else sums
    return Parts(sizes=sizes, pattern=pattern, least=least, column=column, distance=place[later] - column,
                 values=values, diagonal=weights.centre / weights.denominator)


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


def _solve(matrices: Banded, least: np.ndarray, owner: np.ndarray, contest: np.ndarray) -> np.ndarray:
    """Return Λ of each pattern, (len(contest),).

    ``owner`` holds, for each part in ``matrices``, the index of its pattern.
    """
    left, pending = matrices, np.arange(len(least))
    x = np.ones(len(matrices.band))
    low, high = np.zeros(len(least)), np.full(len(least), np.inf)
    first = np.where(left.sizes < 9, 0, FIRST_SHIFT / (np.sqrt(left.sizes) + 1) ** 2)
    shift = np.maximum(least - SHIFT_BELOW, first)
    for solves in ROUND_SOLVES:
        if not len(pending):
            break
        below, value, residual, x = _round(left, shift, low[pending], x=x, solves=solves)
        done = residual <= RESIDUAL_TOLERANCE * value
        low[pending] = np.where(done, value, np.maximum(low[pending], below))
        high[pending] = value
        keep = ~done & _needed(low, high, owner, contest)[pending]
        x = x[left.spread(keep)]
        left = left.where(keep)
        pending = pending[keep]
        shift = np.maximum(low[pending], (value - SHIFT_MARGIN * residual)[keep])
    for hard in pending.tolist():
        low[hard] = high[hard] = np.linalg.eigvalsh(matrices.dense(hard), UPLO='L')[0]
    least, most = _of_patterns(low, high, owner, contest)
    return np.where(_may_win(least, most, contest), most, np.nan)


def _round(matrices: Banded, shift: np.ndarray, low: np.ndarray, x: np.ndarray, solves: int) -> list[np.ndarray]:
    """Return lower bounds, Rayleigh quotients and residual norms, each (K,), and the iterates.

    Each iterate is the result of ``solves`` inverse iterations.
    """
    return [np.concatenate(column) for column in zip(*(
        _iterate(*matrices.part(chunk).factorised(shift[chunk], low[chunk]), x[matrices.rows(chunk)], solves)
        for chunk in _chunks(matrices.sizes)))]


def _chunks(sizes: np.ndarray) -> list[slice]:
    """Return slices that cut a row of matrices into chunks of about CHUNK_COLUMNS columns."""
    cuts = np.flatnonzero(np.diff(np.cumsum(sizes) // CHUNK_COLUMNS, prepend=-1))
    return [slice(a, b) for a, b in zip(cuts, [*cuts[1:], len(sizes)])]


def _iterate(factor: Banded, shift: np.ndarray, x: np.ndarray, solves: int) -> tuple[np.ndarray, ...]:
    for _ in range(solves - 1):
        x = factor.solved(x)
    previous = x * factor.spread(1 / factor.norms(x))
    x = factor.solved(previous)
    below = shift + factor.least(previous / x)
    scale = factor.spread(1 / factor.norms(x))
    x *= scale
    previous *= scale
    # Because (A - shift) x = previous, the quotient and the residual need no product with A.
    excess = factor.sums(x * previous)
    return below, shift + excess, factor.norms(previous - factor.spread(excess) * x), x


def _needed(low: np.ndarray, high: np.ndarray, owner: np.ndarray, contest: np.ndarray) -> np.ndarray:
    """Return True for each matrix that may still decide a requested Λ. Each Λ lies in [low, high]."""
    least, most = _of_patterns(low, high, owner, contest)
    return _may_win(least, most, contest)[owner] & (low <= most[owner])


def _of_patterns(low: np.ndarray, high: np.ndarray, owner: np.ndarray,
                 contest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of each pattern's Λ, which is the smallest Λ of its parts."""
    bounds = np.full((2, len(contest)), np.inf)
    np.minimum.at(bounds[0], owner, low)
    np.minimum.at(bounds[1], owner, high)
    return bounds[0], bounds[1]


def _may_win(least: np.ndarray, most: np.ndarray, contest: np.ndarray) -> np.ndarray:
    """Return True for each pattern whose Λ may be extreme in its contest.

    The result is also True for a pattern in no contest.
    """
    may = contest < 0
    inside = contest[~may]
    smallest, greatest = np.full((2, contest.max(initial=0) + 1), np.inf)
    np.minimum.at(smallest, inside, most[~may])
    np.minimum.at(greatest, inside, -least[~may])
    may[~may] = (least[~may] <= smallest[inside]) | (most[~may] >= -greatest[inside])
    return may
