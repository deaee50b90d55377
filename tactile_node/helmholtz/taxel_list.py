"""List the taxels of patterns, and build the Laplacian A = -h² Δ_h of each pattern (section 2 of the paper).

The Laplacian has five or nine points. A pattern is a bool mask, (rows, cols). The active taxels of a pattern are
numbered row by row, from left to right. Outside the pattern, Φ = 0. For N active taxels, A is therefore N×N, symmetric
and positive definite. Every feature is a sum over the taxel list.

The 46 rotated patterns of one contact (section 6) are processed together. The list contains only whole numbers, so sums
are exact. The sums depend neither on the order of summation nor on the position of the pattern.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np


class Stencil(IntEnum):
    """The discrete Laplacian, named by its number of points, as in the indices of the paper."""

    FIVE = 5
    NINE = 9


class Weights(NamedTuple):
    """Entries of A as whole numbers over a common denominator, so that their sums are exact."""

    centre: int
    edge: int    #: weight of each active edge neighbour
    corner: int  #: weight of each active diagonal neighbour
    denominator: int


WEIGHTS = {Stencil.FIVE: Weights(4, -1, 0, 1), Stencil.NINE: Weights(20, -4, -1, 6)}


class TaxelList(NamedTuple):
    """The active taxels of K patterns, pattern by pattern and row by row.

    All arrays have the shape (total,) unless another shape is given.
    """

    shape: tuple[int, int, int]  #: K, padded rows, padded cols
    site: np.ndarray             #: index of the taxel in the padded and flattened stack
    start: np.ndarray            #: number of taxels before each pattern, shape (K + 1,)
    counts: np.ndarray           #: N of each pattern, shape (K,)
    number: np.ndarray           #: number of the taxel within its pattern, starting at 0
    earlier_edge: np.ndarray     #: number of edge neighbours before the taxel (above, left): 0-2
    earlier_corner: np.ndarray   #: number of diagonal neighbours before the taxel (above): 0-2
    later_edge: np.ndarray       #: number of edge neighbours after the taxel (right, below)
    later_corner: np.ndarray     #: number of diagonal neighbours after the taxel (below)

    @property
    def total(self) -> int:
        return len(self.site)

    def per_pattern(self, values: np.ndarray) -> np.ndarray:
        """Return the sum over each pattern, (K,), of whole numbers given per taxel."""
        some, sums = np.flatnonzero(self.counts), np.zeros(len(self.counts), np.int64)
        sums[some] = np.add.reduceat(values, self.start[some], dtype=np.int64) if len(some) else 0
        return sums

    def row_sums(self, weights: Weights) -> np.ndarray:
        """Return Σ_j A(i,j) for each taxel, multiplied by the denominator of ``weights``."""
        sums: np.ndarray = (self.earlier_edge + self.later_edge) * np.int16(weights.edge)
        if weights.corner:
            sums += (self.earlier_corner + self.later_corner) * np.int16(weights.corner)
        sums += np.int16(weights.centre)
        return sums

    def border(self, weights: Weights) -> np.ndarray:
        """Return masks of the taxels whose row sum is not zero (C_hr5 and C_hr9 in the paper).

        The masks are (K, rows, cols), without padding.
        """
        stack = np.zeros(self.shape, bool)
        stack.reshape(-1)[self.site] = self.row_sums(weights) != 0
        return stack[:, 1:-1, 1:-1]

    def neighbour_pairs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return all pairs of neighbours.

        The three arrays hold the index of the later taxel, the index of the earlier taxel, and True if both taxels
        share an edge.
        """
        place = np.full(self.shape[0] * self.shape[1] * self.shape[2], -1, np.int32)
        place[self.site] = np.arange(self.total, dtype=np.int32)
        cols = self.shape[2]
        pairs = [_pairs(place, self.site, step) for step in (1, cols, cols - 1, cols + 1)]
        later, earlier = (np.concatenate(side) for side in zip(*pairs))
        is_edge = np.arange(len(later)) < len(pairs[0][0]) + len(pairs[1][0])
        return later, earlier, is_edge


def taxel_list(masks: np.ndarray) -> TaxelList:
    """Return the list of the active taxels of ``masks``, bool (K, rows, cols)."""
    ringed = np.zeros((masks.shape[0], masks.shape[1] + 2, masks.shape[2] + 2), bool)
    ringed[:, 1:-1, 1:-1] = masks
    return ringed_taxel_list(ringed)


def ringed_taxel_list(masks: np.ndarray) -> TaxelList:
    """Return the list of the active taxels of ``masks``, which already have a ring of inactive taxels.

    ``masks`` are contiguous. Because of the ring, a single shift of the flat array reaches each neighbour, and no row
    runs into the next.
    """
    count, rows, wide = masks.shape
    active = masks.reshape(-1)
    site = np.flatnonzero(active)
    start = np.searchsorted(site, np.arange(count + 1) * (rows * wide))
    counts = start[1:] - start[:-1]
    number = np.arange(len(site), dtype=np.int32) - np.repeat(start[:-1].astype(np.int32), counts)
    flags = active.view(np.uint8)
    (edge_before, edge_after), (corner_before, corner_after) = (
        _neighbours(flags, 1, wide), _neighbours(flags, wide - 1, wide + 1))
    return TaxelList(shape=masks.shape, site=site, start=start, counts=counts, number=number,
                     earlier_edge=edge_before.take(site), earlier_corner=corner_before.take(site),
                     later_edge=edge_after.take(site), later_corner=corner_after.take(site))


def _neighbours(active: np.ndarray, near: int, far: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of active taxels ``near`` and ``far`` places before each site, and the number after each
    site."""
    before, after = np.zeros((2, len(active)), np.uint8)
    before[near:] = active[:-near]
    before[far:] += active[:-far]
    after[:-near] = active[near:]
    after[:-far] += active[far:]
    return before, after


def _pairs(place: np.ndarray, site: np.ndarray, step: int) -> tuple[np.ndarray, np.ndarray]:
    earlier = place[site - step]
    later = np.flatnonzero(earlier >= 0)
    return later, earlier[later]
