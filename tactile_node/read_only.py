"""Arrays that pass between stages are read-only."""

import numpy as np


def read_only(array: np.ndarray) -> np.ndarray:
    """The array itself, no longer writeable: no stage may change what another one made."""
    array.flags.writeable = False
    return array
