"""Check that readings are in their unit, because users may pass counts or fractions of full scale as pascals by
mistake."""

import numpy as np

from tactile_node.contact.pattern import PatternExtractor, are_alike
from tactile_node.contact.press import are_on_off
from tactile_node.errors import InputError
from tactile_node.taxel_frame import LEAST_BY_UNIT

#: A contact below this share of its unit's smallest contact (LEAST_BY_UNIT) is suspect. No skin with steps of 1 Pa
#: shows a contact that low.
LOW_SHARE = 0.2
#: Below this share of its unit's smallest contact, no skin shows a contact, whatever its resolution.
NO_SKIN_SHARE = 1e-3


class UnitScale:
    """Checks the readings of one pad until a reading reaches the smallest contact of the unit (LEAST_BY_UNIT).

    Parameters
    ----------
    unit : str or None
        Unit of the readings. If the unit is None, nothing is checked.
    most : float
        Share of the unit's smallest contact below which a contact is an error.
    """

    def __init__(self, unit: str | None, most: float = LOW_SHARE):
        self.unit, self._most = unit, most
        self._least = LEAST_BY_UNIT.get(unit or '', 0.0)

    def doubt(self, frame: np.ndarray) -> InputError | None:
        """Return an error if a frame shows a contact that is too low for the unit, otherwise None.

        Parameters
        ----------
        frame : np.ndarray
            Taxel values, bool or float (rows, cols). A frame of bool values is never suspect.

        Returns
        -------
        InputError or None
            Error to be raised or reported, or None. Contacts above NO_SKIN_SHARE are suspect only if the readings are
            whole numbers or on/off.
        """
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
                          got=f'a contact of at most {largest:g}, which looks like counts or fractions of full scale',
                          remedy='Give counts no unit, or convert them. In a layout, correct unit and scale.')


def _have_step_1(readings: np.ndarray) -> bool:
    """Return True if ``readings`` are on/off, or are whole numbers whose only common step is 1."""
    whole = np.rint(readings).clip(-1e6, 1e6)
    return bool((whole == readings).all() and (np.gcd.reduce(whole.astype(int)) == 1 or are_on_off(readings)))
