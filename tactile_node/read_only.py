"""Arrays that pass between stages are read-only."""

import numpy as np


def read_only(array: np.ndarray) -> np.ndarray:
    """The array itself, no longer writeable: what passes between stages is nobody's to change."""
    array.flags.writeable = False
    return array
