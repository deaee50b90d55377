"""Taxel values -> contact pattern: threshold with hysteresis, then the largest contact."""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from tactile_node.errors import ConfigurationError, InputError

EIGHT_CONNECTED = np.ones((3, 3), bool)
EIGHT_CONNECTED.flags.writeable = False


class ContactPattern(NamedTuple):
    """The taxels pressed together; arrays are read-only, of shape (rows, cols)."""

    mask: np.ndarray    #: bool, the largest contact
    values: np.ndarray  #: float, the frame's values, NaN where a taxel has no valid one
    contacts: int       #: number of separate contacts on the pad, 0 when it is empty


class PatternExtractor:
    """Extracts the contact pattern of successive frames of one pad.

    A taxel becomes pressed at ``press_threshold`` or above and is released below ``release_threshold``
    (same unit as the values). A taxel without a valid value (NaN, infinite) is not in the pattern, but keeps its
    hysteresis state for when it is valid again. One exception: invalid taxels fully enclosed by the
    contact are filled in, for a dead taxel under an object is no hole of the object.

    Raises ConfigurationError unless 0 < release_threshold <= press_threshold.
    """

    def __init__(self, press_threshold: float, release_threshold: float):
        if not 0 < release_threshold <= press_threshold < np.inf:
            raise ConfigurationError(
                'press and release thresholds', expected='0 < release <= press, finite',
                got=f'press {press_threshold}, release {release_threshold}',
                remedy='Give both in the unit of the taxel values, release a little lower than press.')
        self._press, self._release = press_threshold, release_threshold
        self._pressed: np.ndarray | None = None

    def reset(self) -> None:
        """Forget which taxels were pressed."""
        self._pressed = None

    def extract(self, values: np.ndarray) -> ContactPattern:
        """Return the contact pattern of a frame, float, shape (rows, cols) (another shape than before starts anew).

        Raises InputError where ``values`` is not such an array.
        """
        values = _frame(values)
        valid = np.isfinite(values)
        pressed = self._update(values, valid)
        mask, contacts = largest_contact(pressed & valid)
        if not valid.all():
            mask = _with_enclosed(mask, ~valid)
        return ContactPattern(_read_only(mask), _read_only(np.where(valid, values, np.nan)), contacts)

    def _update(self, values: np.ndarray, valid: np.ndarray) -> np.ndarray:
        before = self._pressed
        if before is None or before.shape != values.shape:
            before = np.zeros(values.shape, bool)
        # Comparisons with NaN are false, as wanted: neither pressed nor released.
        pressed = (before & ~(valid & (values < self._release))) | (valid & (values >= self._press))
        self._pressed = pressed
        return pressed


def largest_contact(active: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the mask of the largest 8-connected contact of ``active`` and the number of contacts.

    Of several equally large ones, the first in row-major order.
    """
    labels, contacts = ndimage.label(active, EIGHT_CONNECTED)
    if contacts <= 1:
        return active.copy(), contacts
    sizes = np.bincount(labels.reshape(-1))
    return labels == sizes[1:].argmax() + 1, contacts


def _with_enclosed(mask: np.ndarray, invalid: np.ndarray) -> np.ndarray:
    """Add the 8-connected groups of invalid taxels whose every neighbour is in ``mask``, none at the pad's edge."""
    labels, count = ndimage.label(invalid, EIGHT_CONNECTED)
    around = np.pad(mask, 1)
    labels = np.pad(labels, 1)
    # Smallest neighbourhood of a group that touches anything but itself and the contact is open.
    open_site = ~around & (labels == 0)
    touches_open = ndimage.binary_dilation(open_site, EIGHT_CONNECTED)
    open_groups = np.zeros(count + 1, bool)
    open_groups[labels[touches_open]] = True
    open_groups[0] = True
    return mask | ~open_groups[labels[1:-1, 1:-1]]


def _frame(values: np.ndarray) -> np.ndarray:
    values = np.asarray(values)
    if values.ndim != 2 or not values.size or values.dtype.kind not in 'biuf':
        raise InputError('taxel frame', expected='real numbers, shape (rows, cols)',
                         got=f'{values.dtype}, shape {values.shape}', remedy='Pass one frame of one pad.')
    return values.astype(float, copy=False)


def _read_only(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array
