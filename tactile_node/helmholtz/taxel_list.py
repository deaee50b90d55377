"""Section 2: the taxels of patterns as one list, and by it the five- and nine-point Laplacian A = -h² Δ_h of each.

A pattern is a bool mask, shape (rows, cols); its active taxels are numbered row by row, left to right. Outside the
pattern Φ = 0, so A of N active taxels is N×N, symmetric and positive definite. Every feature is summed from the list.

The 46 rotated patterns of one contact (section 6) are processed together. Everything here is a whole
number, so sums are exact: they depend neither on the order of summation nor on where the pattern lies.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np


class Stencil(IntEnum):
    """The discrete Laplacian, called by its number of points as in the paper's indices."""

    FIVE = 5
    NINE = 9


class Weights(NamedTuple):
    """Entries of A as whole numbers over a common denominator, so that sums of them are exact."""

    centre: int
    edge: int      #: for each active edge neighbour
    corner: int    #: for each active diagonal neighbour
    denominator: int


WEIGHTS = {Stencil.FIVE: Weights(4, -1, 0, 1), Stencil.NINE: Weights(20, -4, -1, 6)}


class TaxelList(NamedTuple):
    """The active taxels of K patterns, pattern by pattern, each row by row; arrays of shape (total,)
    unless another shape is given."""

    shape: tuple[int, int, int]  #: K, padded rows, padded cols
    site: np.ndarray             #: place of the taxel in the padded, flattened stack
    start: np.ndarray            #: number of taxels before each pattern, shape (K + 1,)
    counts: np.ndarray           #: N of each pattern, shape (K,)
    number: np.ndarray           #: number of the taxel within its pattern, from 0
    earlier_edge: np.ndarray     #: how many edge neighbours precede the taxel (above, left): 0-2
    earlier_corner: np.ndarray   #: how many diagonal neighbours precede the taxel (above): 0-2
    later_edge: np.ndarray       #: how many edge neighbours follow the taxel (right, below)
    later_corner: np.ndarray     #: how many diagonal neighbours follow the taxel (below)

    @property
    def total(self) -> int:
        return len(self.site)

    def per_pattern(self, values: np.ndarray) -> np.ndarray:
        """Sum whole numbers, one a taxel, over each pattern; shape (K,)."""
        some, sums = np.flatnonzero(self.counts), np.zeros(len(self.counts), np.int64)
        sums[some] = np.add.reduceat(values, self.start[some], dtype=np.int64) if len(some) else 0
        return sums

    def row_sums(self, weights: Weights) -> np.ndarray:
        """Σ_j A(i,j) of each taxel, times the denominator of ``weights``."""
        sums: np.ndarray = (self.earlier_edge + self.later_edge) * np.int16(weights.edge)
        if weights.corner:
            sums += (self.earlier_corner + self.later_corner) * np.int16(weights.corner)
        sums += np.int16(weights.centre)
        return sums

    def border(self, weights: Weights) -> np.ndarray:
        """Masks of the taxels whose row sum is not zero (the paper's C_hr5, C_hr9), without padding; (K, rows, cols).
        """
        stack = np.zeros(self.shape, bool)
        stack.reshape(-1)[self.site] = self.row_sums(weights) != 0
        return stack[:, 1:-1, 1:-1]

    def neighbour_pairs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """All pairs of neighbours: index of the later, of the earlier one, and whether they share an edge."""
        place = np.full(self.shape[0] * self.shape[1] * self.shape[2], -1, np.int32)
        place[self.site] = np.arange(self.total, dtype=np.int32)
        cols = self.shape[2]
        pairs = [_pairs(place, self.site, step) for step in (1, cols, cols - 1, cols + 1)]
        later, earlier = (np.concatenate(side) for side in zip(*pairs))
        is_edge = np.arange(len(later)) < len(pairs[0][0]) + len(pairs[1][0])
        return later, earlier, is_edge


def taxel_list(masks: np.ndarray) -> TaxelList:
    """List the active taxels of ``masks``, bool, shape (K, rows, cols)."""
    ringed = np.zeros((masks.shape[0], masks.shape[1] + 2, masks.shape[2] + 2), bool)
    ringed[:, 1:-1, 1:-1] = masks
    return ringed_taxel_list(ringed)


def ringed_taxel_list(masks: np.ndarray) -> TaxelList:
    """List the active taxels of ``masks`` (contiguous), each surrounded by a ring of inactive taxels already.

    The ring lets one flat shift stand for a neighbour: no row runs into the next.
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
    """Count, at each site, the active taxels ``near`` and ``far`` places before it, and after it."""
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
