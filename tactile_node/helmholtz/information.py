"""Section 4: the information a pattern brings, from the row sums s_i = Σ_j A(i,j)."""

from typing import NamedTuple

import numpy as np

from tactile_node.helmholtz.operators import WEIGHTS, Stencil
from tactile_node.helmholtz.taxel_list import TaxelList


class Information(NamedTuple):
    """The paper's three measures, each of shape (K,)."""

    sum: np.ndarray   #: Σ s_i, >= 0
    sq: np.ndarray    #: Σ s_i², vertices and edges accented
    norm: np.ndarray  #: Σ s_i² / N, the classifier's I; NaN for an empty pattern


def information(taxels: TaxelList, stencil: Stencil) -> Information:
    """Return the information measures of each of the K patterns of ``taxels``."""
    weights = WEIGHTS[stencil]
    sums = taxels.row_sums(weights)
    squared = taxels.per_pattern(sums * sums) / weights.denominator ** 2
    with np.errstate(invalid='ignore'):
        return Information(taxels.per_pattern(sums) / weights.denominator, squared, squared / taxels.counts)
