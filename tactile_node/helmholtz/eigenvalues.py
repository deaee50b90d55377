"""Section 3: Λ, the smallest eigenvalue of A, of many patterns at once.

The connected parts of all patterns are laid along the diagonal of one banded matrix and solved together by
inverse iteration from a positive vector, which in an M-matrix stays positive and so finds the ground state.
Each round gives certain bounds of every Λ:

- from above the Rayleigh quotient θ of the iterate;
- from below, as (A - s) x = x' with x, x' > 0 entails Λ >= s + min x'_i / x_i (Collatz-Wielandt); and any s
  for which A - s has a Cholesky factor.

An iterate x, ‖x‖ = 1, has an eigenvalue within ‖A x - θ x‖ of θ; it is accepted at 2e-10 θ. Otherwise the
next round shifts to just below θ. Where only the extremes over the rotations are requested, what cannot be extreme
by these bounds is left out, most of it after the first round. What does not converge in time (nearly equal
eigenvalues of weakly joined parts) goes to a dense solver.
"""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.helmholtz.banded import Banded
from tactile_node.helmholtz.taxel_list import WEIGHTS, Stencil, TaxelList

RESIDUAL_TOLERANCE = 2e-10  #: relative to the eigenvalue
ROUND_SOLVES = (3, 4, 4, 3, 2, 2, 2)  #: inverse iterations of each round
SHIFT_MARGIN = 1.2  #: distance of the shift below the Rayleigh quotient, in residuals
FIRST_SHIFT = 0.7 * np.pi * 2.404825557695773 ** 2  #: times area; a disc has the least (Faber-Krahn)
SHIFT_BELOW = 0.02  #: how far the first shift stays below the least row sum, which is a lower bound itself
CHUNK_COLUMNS = 5_000  #: taxels treated together, to stay within the processor's cache

_NEIGHBOURS = {Stencil.FIVE: ndimage.generate_binary_structure(2, 1),
               Stencil.NINE: ndimage.generate_binary_structure(2, 2)}


def smallest_eigenvalues(problems: list[tuple[TaxelList, Stencil]],
                         extremes_from: int | None = None) -> list[np.ndarray]:
    """Return Λ of each of the patterns of each list, by the stencil beside it, shape (K,); NaN for an empty one.

    With ``extremes_from`` f, the patterns from f on are there for their least and greatest Λ only: NaN
    for those that are neither.
    """
    parts = [_connected(taxels, stencil) for taxels, stencil in problems]
    counts = [len(taxels.counts) for taxels, _ in problems]
    first = np.cumsum([0, *counts])
    owner = np.concatenate([part.pattern + offset for part, offset in zip(parts, first)])
    # which contest for the extremes each pattern takes part in; -1 is none
    contest = np.concatenate([np.where(np.arange(count) < (count if extremes_from is None else extremes_from), -1, i)
                              for i, count in enumerate(counts)])
    some, owner = np.unique(owner, return_inverse=True)
    found = np.full(first[-1], np.nan)
    found[some] = _solve(_banded(parts), np.concatenate([part.least for part in parts]), owner, contest[some])
    return np.split(found, first[1:-1])


class Parts(NamedTuple):
    """The connected parts of all patterns of a list: A falls into one block for each of them."""

    sizes: np.ndarray     #: taxels of each part
    pattern: np.ndarray   #: which pattern each part belongs to, rising
    least: np.ndarray     #: least row sum of each part, a lower bound of its Λ
    column: np.ndarray    #: column of each entry of A below the diagonal, taxels numbered part by part
    distance: np.ndarray  #: distance of each entry from the diagonal
    values: np.ndarray    #: the entries
    diagonal: float


def _connected(taxels: TaxelList, stencil: Stencil) -> Parts:
    weights = WEIGHTS[stencil]
    active = np.zeros(taxels.shape, bool)
    active.reshape(-1)[taxels.site] = True
    # One below the other: the ring around each keeps the patterns apart.
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
    """Λ of each pattern (of len(contest)); ``owner``: which pattern each part, one of ``matrices``, belongs to."""
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
    """Lower bounds, Rayleigh quotients, residual norms, each of shape (K,), and iterates after some solves."""
    return [np.concatenate(column) for column in zip(*(
        _iterate(*matrices.part(chunk).factorised(shift[chunk], low[chunk]), x[matrices.rows(chunk)], solves)
        for chunk in _chunks(matrices.sizes)))]


def _chunks(sizes: np.ndarray) -> list[slice]:
    """Cut a row of matrices into slices of about CHUNK_COLUMNS columns each."""
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
    # (A - shift) x = previous, scaled: neither the quotient nor the residual needs a product with A.
    excess = factor.sums(x * previous)
    return below, shift + excess, factor.norms(previous - factor.spread(excess) * x), x


def _needed(low: np.ndarray, high: np.ndarray, owner: np.ndarray, contest: np.ndarray) -> np.ndarray:
    """Which matrices may still decide a pattern's Λ that is requested, all Λ being in [low, high]."""
    least, most = _of_patterns(low, high, owner, contest)
    return _may_win(least, most, contest)[owner] & (low <= most[owner])


def _of_patterns(low: np.ndarray, high: np.ndarray, owner: np.ndarray,
                 contest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of the patterns' Λ: a pattern has the least of its parts'."""
    bounds = np.full((2, len(contest)), np.inf)
    np.minimum.at(bounds[0], owner, low)
    np.minimum.at(bounds[1], owner, high)
    return bounds[0], bounds[1]


def _may_win(least: np.ndarray, most: np.ndarray, contest: np.ndarray) -> np.ndarray:
    """Which patterns are in no contest, or may have its smallest or its greatest Λ."""
    may = contest < 0
    inside = contest[~may]
    smallest, greatest = np.full((2, contest.max(initial=0) + 1), np.inf)
    np.minimum.at(smallest, inside, most[~may])
    np.minimum.at(greatest, inside, -least[~may])
    may[~may] = (least[~may] <= smallest[inside]) | (most[~may] >= -greatest[inside])
    return may
