"""Section 5: the centre of gravity of the normalised matrix A, from its strictly lower triangle."""

from typing import NamedTuple

import numpy as np

from tactile_node.helmholtz.operators import WEIGHTS, Stencil
from tactile_node.helmholtz.taxel_list import TaxelList, Weights


class Gravity(NamedTuple):
    """The centre of gravity T in both coordinate systems, each of shape (K,).

    NaN where no two active taxels are neighbours by the stencil: there is nothing to weigh.
    """

    x: np.ndarray
    y: np.ndarray
    V: np.ndarray      #: distance from the origin, sqrt(x² + y²)
    alpha: np.ndarray  #: arctan2(x, y) [degrees]


def gravity(taxels: TaxelList, stencil: Stencil) -> Gravity:
    """Return the centre of gravity of each of the K patterns of ``taxels``.

    A pair of neighbours i > j weighs A(i,j) at (i-1)/(N-1), (j-1)/(N-1); summed over i the weights are
    those of the neighbours before each taxel, summed over j those of the neighbours after it.
    """
    weights = WEIGHTS[stencil]
    before = _weigh(taxels.earlier_edge, taxels.earlier_corner, weights)
    after = _weigh(taxels.later_edge, taxels.later_corner, weights)
    with np.errstate(invalid='ignore', divide='ignore'):
        scale = taxels.per_pattern(before) * (taxels.counts - 1)
        x = taxels.per_pattern(before * taxels.number) / scale
        y = taxels.per_pattern(after * taxels.number) / scale
    return Gravity(x, y, np.sqrt(x * x + y * y), np.degrees(np.arctan2(x, y)))


def _weigh(edge: np.ndarray, corner: np.ndarray, weights: Weights) -> np.ndarray:
    weighed: np.ndarray = edge * np.int32(-weights.edge)
    return weighed + corner * np.int32(-weights.corner) if weights.corner else weighed
