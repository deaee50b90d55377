"""Whether something presses a pad that is to be tared, by levels that no parameter changes."""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import label

from tactile_node.conditioning.limits import TARE_LIMIT_BY_UNIT
from tactile_node.press_levels import PRESS_BY_UNIT, RELEASE_RATIO

RAISED_TAXELS = 3  #: connected taxels that stand out make a contact; fewer may be faulty
BACKGROUND = 0.25  #: quantile of the loads taken for what nothing presses: an object may cover the rest
LOWEST = 0.05      #: quantile; BACKGROUND - LOWEST is 0.97 standard deviations of normal offsets
SPREADS = 6.0      #: such distances above the background that no offset reaches


class ContactGuard(NamedTuple):
    """Finds a contact in readings. Levels are of published values: gain x (reading - zero).

    A taxel is pressed from ``press`` on, and until it reads less than RELEASE_RATIO of it: the processor, by its
    defaults, reports such a contact. RAISED_TAXELS connected taxels are pressed too where they read ``raised`` more
    than the pad's background, and more than its offsets vary: before the first tare a contact may hide in a low offset.
    """

    press: float
    raised: float
    gains: np.ndarray | float = 1.0  #: (rows, cols) or one for all

    @classmethod
    def of_unit(cls, unit: str, gains: np.ndarray | float = 1.0) -> 'ContactGuard':
        """``unit``: of the taxels, one of PRESS_BY_UNIT."""
        return cls(PRESS_BY_UNIT[unit], TARE_LIMIT_BY_UNIT.get(unit, np.inf), gains)

    def pressed(self, readings: np.ndarray, zero: np.ndarray | float) -> np.ndarray:
        """Return the pressed taxels, bool (rows, cols), of successive readings (K, rows, cols), NaN where invalid.

        >>> guard = ContactGuard.of_unit('Pa')
        >>> guard.pressed(np.array([[[0.0, 0.0, 40e3]]]), zero=0.0).tolist()
        [[False, False, True]]
        """
        loads = self.gains * (readings - zero)
        valid = np.isfinite(loads)
        known: np.ndarray = np.asarray(valid.any(0))
        mean = np.where(valid, loads, 0).sum(0) / np.maximum(valid.sum(0), 1)
        highest = np.where(valid, loads, -np.inf).max(0)
        pressed: np.ndarray = known & ((mean >= RELEASE_RATIO * self.press) | (highest >= self.press))
        return pressed | self._standing_out(mean, known)

    def _standing_out(self, mean: np.ndarray, known: np.ndarray) -> np.ndarray:
        if not known.any():
            return known
        lowest, background = np.quantile(mean[known], (LOWEST, BACKGROUND))
        raised = known & (mean >= background + max(self.raised, SPREADS * (background - lowest)))
        groups, count = label(raised, np.ones((3, 3)))
        sizes = np.bincount(groups.ravel(), minlength=count + 1)
        sizes[0] = 0
        of_contacts: np.ndarray = (sizes >= RAISED_TAXELS)[groups]
        return of_contacts
