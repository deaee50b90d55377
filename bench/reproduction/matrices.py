"""Compute the matrix A, the border taxels and the features at each angle, for figures and experiments."""

import numpy as np
from scipy import sparse

from tactile_node.helmholtz.features import Group, describe
from tactile_node.helmholtz.rotation import with_rotated
from tactile_node.helmholtz.taxel_list import WEIGHTS, Stencil, ringed_taxel_list, taxel_list


def matrix(mask: np.ndarray, stencil: Stencil) -> sparse.csr_array:
    """Return the (N, N) matrix A of the N active taxels in ``mask``.

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


def border(mask: np.ndarray, stencil: Stencil) -> np.ndarray:
    """Return the mask of the border taxels, which are active and have an inactive neighbour within the stencil."""
    return taxel_list(mask[np.newaxis]).border(WEIGHTS[stencil])[0]


def features_at_angles(mask: np.ndarray, groups: Group) -> dict[str, np.ndarray]:
    """Return each feature at each of the 46 ANGLES. ``mask`` must have an active taxel."""
    return describe(ringed_taxel_list(with_rotated(mask)[1:]), groups, is_solved=True)
