"""Taxel values -> contact pattern: threshold with hysteresis, then the largest contact."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage

from tactile_node.contact.press import PressThresholds
from tactile_node.errors import InputError
from tactile_node.read_only import read_only

EIGHT_CONNECTED = read_only(np.ones((3, 3), bool))


class ContactPattern(NamedTuple):
    """The taxels pressed together; arrays are read-only, of shape (rows, cols)."""

    mask: np.ndarray    #: bool, the largest contact
    values: np.ndarray  #: float, the frame's values, NaN where a taxel has no valid one
    contacts: int       #: number of separate contacts on the pad, 0 when it is empty


class PatternExtractor:
    """Extracts the contact pattern of successive frames of one pad.

    A taxel becomes pressed at the press threshold or above and is released below the release threshold. A
    taxel without a valid value (NaN, infinite) is not in the pattern, but keeps its hysteresis state for when
    it is valid again. One exception: invalid taxels fully enclosed by the contact are filled in, for a dead
    taxel under an object is no hole of the object. A bool frame is itself the pressed taxels.

    With ``largest`` False the pattern is every pressed taxel of the pad, not the largest contact alone.
    """

    def __init__(self, thresholds: PressThresholds, *, largest: bool = True):
        self._thresholds = thresholds
        self._largest = largest
        self._pressed: np.ndarray | None = None

    def extract(self, values: ArrayLike) -> ContactPattern:
        """Return the contact pattern of a frame, real numbers or bool, shape (rows, cols).

        A frame of another shape than the one before starts again without a pressed taxel. Raises InputError
        for anything else.
        """
        frame = as_frame(values)
        numbers = frame.astype(float, copy=False)
        valid = np.isfinite(numbers)
        pressed = frame if frame.dtype == bool else self._update(numbers, valid) & valid
        largest, contacts = largest_contact(pressed)
        mask = _with_enclosed(largest if self._largest else pressed.copy(), valid)
        return ContactPattern(read_only(mask), read_only(np.where(valid, numbers, np.nan)), contacts)

    def _update(self, values: np.ndarray, valid: np.ndarray) -> np.ndarray:
        before = self._pressed
        if before is None or before.shape != values.shape:
            before = np.zeros(values.shape, bool)
        # Comparisons with NaN are false, as wanted: neither pressed nor released.
        pressed = before & ~(valid & (values < self._thresholds.release))
        pressed |= valid & (values >= self._thresholds.press)
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


def _with_enclosed(mask: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Add the groups of invalid taxels with only taxels of ``mask`` around them; the pad's edge is open."""
    if valid.all():
        return mask
    labels, count = ndimage.label(np.pad(~valid, 1), EIGHT_CONNECTED)
    outside = ~np.pad(mask, 1) & (labels == 0)
    is_open = np.zeros(count + 1, bool)
    is_open[labels[ndimage.binary_dilation(outside, EIGHT_CONNECTED)]] = True
    is_open[0] = True
    with_enclosed: np.ndarray = mask | ~is_open[labels[1:-1, 1:-1]]
    return with_enclosed


def as_frame(values: ArrayLike) -> np.ndarray:
    """Return ``values`` as a frame, bool or float, shape (rows, cols); the masked taxels of a masked array are NaN.

    Raises InputError for anything but real numbers or bool of two dimensions, with at least one taxel.
    """
    try:
        frame = np.ma.filled(np.ma.asarray(values, float), np.nan) if np.ma.is_masked(values) else np.asarray(values)
    except (TypeError, ValueError):
        raise _no_frame('rows of unequal length, or no numbers') from None
    if frame.ndim != 2 or not frame.size or frame.dtype.kind not in 'biuf':
        raise _no_frame(f'{frame.dtype}, shape {frame.shape}')
    return frame if frame.dtype == bool else frame.astype(float, copy=False)


def _no_frame(got: str) -> InputError:
    return InputError('taxel frame', expected='real numbers, shape (rows, cols)', got=got,
                      remedy='Pass one frame of one pad.')
