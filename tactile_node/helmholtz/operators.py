"""Section 2: the five- and nine-point Laplacian of a tactile pattern and its matrix A = -h² Δ_h.

A pattern is a bool mask, shape (rows, cols); its active taxels are numbered row by row, left to right.
Outside the pattern Φ = 0, so A of N active taxels is N×N, symmetric and positive definite.
"""

from enum import IntEnum

import numpy as np
from scipy import sparse

from tactile_node.helmholtz.taxel_list import Weights, taxel_list


class Stencil(IntEnum):
    """The discrete Laplacian, called by its number of points as in the paper's indices."""

    FIVE = 5
    NINE = 9


WEIGHTS = {Stencil.FIVE: Weights(4, -1, 0, 1), Stencil.NINE: Weights(20, -4, -1, 6)}


def matrix(mask: np.ndarray, stencil: Stencil) -> sparse.csr_array:
    """Return A of the active taxels of ``mask``, shape (N, N).

    >>> matrix(np.array([[True, True]]), Stencil.FIVE).toarray()
    array([[ 4., -1.],
           [-1.,  4.]])
    """
    taxels, weights = taxel_list(mask[np.newaxis]), WEIGHTS[stencil]
    later, earlier, is_edge = taxels.neighbour_pairs()
    values = np.where(is_edge, weights.edge, weights.corner) / weights.denominator
    lower = sparse.coo_array((values, (later, earlier)), shape=(taxels.total, taxels.total))
    centre = np.full((1, taxels.total), weights.centre / weights.denominator)
    diagonal = sparse.dia_array((centre, [0]), shape=(taxels.total, taxels.total))
    full = sparse.csr_array(lower + lower.T + diagonal)
    full.eliminate_zeros()
    return full


def row_sums(mask: np.ndarray, stencil: Stencil) -> np.ndarray:
    """Return s_i = Σ_j A(i,j) of every active taxel in the order of their numbers, shape (N,)."""
    sums: np.ndarray = taxel_list(mask[np.newaxis]).row_sums(WEIGHTS[stencil]) / WEIGHTS[stencil].denominator
    return sums


def border(mask: np.ndarray, stencil: Stencil) -> np.ndarray:
    """Return the mask of the border taxels: active, with an inactive neighbour of that stencil.

    Those are the taxels whose row sum in A is not zero (the paper's C_hr5, C_hr9).
    """
    mask_of_border: np.ndarray = taxel_list(mask[np.newaxis]).border(WEIGHTS[stencil])[0]
    return mask_of_border
