"""Find the outline of a contact on a skin whose readings around the contact are high.

`contact.standing_out` draws the outline of a contact at half of its level. On a skin with a wide halo, taxels that
nothing touches read more than that. Single readings do not show where the contact ends, because the gains of the
taxels differ. The readings that are averaged over neighbouring taxels fall steepest where the contact ends.
"""

import numpy as np
from scipy import ndimage

from tactile_node.contact.neighbours import EIGHT_CONNECTED, box_of
from tactile_node.contact.press import are_on_off

#: The constants below were found with a real 8x16 array. STEEPER and LEAST_SHARE were then set so that no rate falls on
#: the other open arrays and on computed contacts with and without a halo (validation seeds).
FEWEST_TAXELS = 30  #: Smallest contact whose outline is moved. In a smaller one, most taxels lie at the outline.
SMOOTHING = 0.7     #: Standard deviation of the Gaussian filter that averages the gains [pitches].
LEVELS = (0.6, 0.7, 0.8)  #: Levels at which an outline is tried, as shares of the contact's mean smoothed reading.
STEEPER = 1.2       #: The readings must fall this many times as steeply across the new outline.
#: Smallest share of the contact's taxels within the new outline. A smaller part may be a fragment of an object that
#: presses unevenly.
LEAST_SHARE = 0.65
SMOOTHING_REACH = 2  #: Distance beyond the contact from which readings are averaged [taxels].
SQUARE = np.ones((2, 2), bool)  #: Smallest part of a contact. Thinner parts are bridges to other taxels.


def steepest_outline(values: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the contact within the outline at which its readings fall steepest, or ``mask`` without such an outline.

    Parameters
    ----------
    values : np.ndarray
        Taxel values of the frame, float (rows, cols), with NaN for a missing value.
    mask : np.ndarray
        Taxels of the contact, bool (rows, cols).

    Returns
    -------
    np.ndarray
        Taxels within the outline, bool (rows, cols). All of them are taxels of ``mask``.

    Examples
    --------
    >>> values = np.zeros((15, 15))
    >>> values[2:13, 2:13] = 0.4  # a halo around a contact of 9x9 taxels
    >>> values[3:12, 3:12] = 1.0
    >>> within = steepest_outline(values, values > 0)
    >>> bool((within == (values == 1.0)).all())
    True
    """
    if np.count_nonzero(mask) < FEWEST_TAXELS or are_on_off(values):
        return mask
    box = box_of(mask, SMOOTHING_REACH)
    inside, smooth = mask[box], _smoothed(values[box])
    falls = tuple(np.diff(smooth, axis=axis) for axis in (0, 1))
    mean = smooth[inside].mean()
    tried = [ndimage.binary_opening(inside & (smooth >= level * mean), SQUARE) for level in LEVELS]
    steepest = max(tried, key=lambda taxels: _fall(taxels, falls))
    groups, count = ndimage.label(steepest, EIGHT_CONNECTED)
    if not count:
        return mask
    largest = groups == 1 + np.bincount(groups[steepest])[1:].argmax()
    if (np.count_nonzero(largest) < LEAST_SHARE * np.count_nonzero(inside)
            or _fall(largest, falls) < STEEPER * _fall(inside, falls)):
        return mask
    found = np.zeros_like(mask)
    found[box] = largest
    return found


def _smoothed(values: np.ndarray) -> np.ndarray:
    """Return the average of the values around each taxel. Taxels without a value are left out of the average."""
    seen = np.isfinite(values)
    smooth: np.ndarray = ndimage.gaussian_filter(np.where(seen, values, 0.0), SMOOTHING, mode='nearest')
    if not seen.all():
        weight = ndimage.gaussian_filter(seen.astype(float), SMOOTHING, mode='nearest')
        smooth /= np.maximum(weight, np.finfo(float).tiny)
    return smooth


def _fall(taxels: np.ndarray, falls: tuple[np.ndarray, ...]) -> float:
    """Return the mean fall of the readings across the outline of ``taxels``, per pitch, or 0 without an outline.

    ``falls`` holds the differences of the smoothed readings along the columns and along the rows.
    """
    steps = [np.diff(taxels.astype(np.int8), axis=axis) for axis in (0, 1)]
    crossed = sum(np.count_nonzero(step) for step in steps)
    return float(sum((step * fall).sum() for step, fall in zip(steps, falls)) / max(crossed, 1))
