"""Whether taxels are on/off or give pressures: the one rule for recognition, fit and what is pressed."""

import numpy as np


def are_on_off(values: np.ndarray) -> bool:
    """Return whether all ``values``, finite or NaN (no valid value), are 0 or one other number above it.

    >>> are_on_off(np.array([0.0, 5.0, np.nan])), are_on_off(np.array([0.0, 5.0, 2.0]))
    (True, False)
    """
    highest = np.fmax.reduce(values, axis=None, initial=0.0)
    return bool(((values == 0) | (values == highest) | np.isnan(values)).all())
