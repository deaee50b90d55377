"""Λ of one large connected part: Lanczos iteration (ARPACK) with a sparse factor, ordered for symmetric matrices."""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh, splu


def large_part(matrix: sparse.csc_array) -> float:
    """Return the smallest eigenvalue of ``matrix``, symmetric and positive definite, of 3 rows or more.

    The start is positive, as the ground state is, so that the result is the same in each run.
    """
    # Without an ordering for symmetric matrices the factor would hold some ten times as many numbers.
    factor = splu(matrix, permc_spec='MMD_AT_PLUS_A', diag_pivot_thresh=0.0, options={'SymmetricMode': True})
    inverse = LinearOperator(matrix.shape, factor.solve, dtype=float)
    value, = eigsh(matrix, k=1, sigma=0.0, OPinv=inverse, v0=np.ones(matrix.shape[0]), return_eigenvectors=False)
    return float(value)
