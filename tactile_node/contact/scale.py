"""Whether readings can be of their unit: counts and fractions of full scale are easily passed as pascal."""

import numpy as np

from tactile_node.contact.pattern import PatternExtractor, are_alike
from tactile_node.contact.press import are_on_off
from tactile_node.errors import InputError
from tactile_node.taxel_frame import LEAST_BY_UNIT

LOW_SHARE = 0.2   #: share of the least reading of a unit that counts: no skin shows a contact there in steps of 1 Pa
NO_SKIN_SHARE = 1e-3    #: share below which no skin shows a contact there in any steps


class UnitScale:
    """Follows one pad until a reading is high enough for ``unit``; below ``most`` of that a contact is an error."""

    def __init__(self, unit: str | None, most: float = LOW_SHARE):
        self.unit, self._most = unit, most
        self._least = LEAST_BY_UNIT.get(unit or '', 0.0)

    def doubt(self, frame: np.ndarray) -> InputError | None:
        """Return what is wrong where ``frame``, bool or float, shows a contact too low for the unit, in steps of 1."""
        readings = frame[np.isfinite(frame)]
        largest = np.max(readings, initial=0.0)
        if frame.dtype == bool or largest >= self._least:
            self._least = 0.0
        if not 0 < largest < self._most * self._least:
            return None
        if largest > NO_SKIN_SHARE * self._least and not _have_step_1(readings):
            return None
        found = PatternExtractor().extract(frame)
        if not found.contacts or not are_alike(found.values):
            return None
        return InputError('taxel values', expected=f'contacts of {self._least:g} {self.unit} or more',
                          got=f'one of at most {largest:g}, as of counts or fractions of full scale',
                          remedy='Give counts no unit, or convert them; in a layout correct unit and scale.')


def _have_step_1(readings: np.ndarray) -> bool:
    """Return whether ``readings`` are whole numbers with no common step but 1, or on/off."""
    whole = np.rint(readings).clip(-1e6, 1e6)
    return bool((whole == readings).all() and (np.gcd.reduce(whole.astype(int)) == 1 or are_on_off(readings)))
