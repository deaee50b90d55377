"""The matrix A, the border taxels and the features at each angle of one pattern, for figures and experiments."""

import numpy as np
from scipy import sparse

from tactile_node.helmholtz.features import Group, describe
from tactile_node.helmholtz.rotation import with_rotated
from tactile_node.helmholtz.taxel_list import WEIGHTS, Stencil, ringed_taxel_list, taxel_list


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


def border(mask: np.ndarray, stencil: Stencil) -> np.ndarray:
    """Return the mask of the border taxels: active, with an inactive neighbour of that stencil."""
    return taxel_list(mask[np.newaxis]).border(WEIGHTS[stencil])[0]


def features_at_angles(mask: np.ndarray, groups: Group) -> dict[str, np.ndarray]:
    """Return every feature at each of ANGLES, shape (46,); ``mask`` must have an active taxel."""
    return describe(ringed_taxel_list(with_rotated(mask)[1:]), groups, is_solved=True)
