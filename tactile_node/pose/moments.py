"""Compute the force, centre of pressure, area and principal axis of a contact of any shape."""

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from tactile_node.contact.neighbours import grown
from tactile_node.contact.pattern import ContactPattern
from tactile_node.contact.visibility import Visibility, visibility_of
from tactile_node.errors import ConfigurationError, InputError


def check_pitch(pitch: float) -> None:
    """Raise ConfigurationError unless ``pitch`` is a finite length above 0."""
    try:
        is_length = bool(0 < pitch < np.inf)
    except (TypeError, ValueError):  # pitch is not a number
        is_length = False
    if not is_length:
        raise ConfigurationError('pitch', expected='a length > 0 in metres', got=repr(pitch),
                                 remedy='Give the distance between the centres of neighbouring taxels.')


VALUE_UNITS = ('Pa', 'N', '1')
LEAST_PAIRS = 6  #: Smallest number of neighbouring taxel pairs along an axis from which a slope is computed.

#: A contact has no principal axis if its two second moments differ by at most this share of their sum.
ROUND_DIFFERENCE = 0.02


class ContactMoments(NamedTuple):
    """Moments of one contact in the pad frame.

    A value is NaN if it is undefined or if the pad is not seen.

    The standard deviations follow from the noise of the taxels and are NaN if the noise is unknown.
    """

    #: sum of the forces on the taxels of the contact and of its ring [N]; NaN for an on/off skin
    force: float
    centre_of_pressure: tuple[float, float]  #: [m]
    area: float  #: number of taxels of the contact, including invalid ones, times pitch² [m²]
    filled: int  #: number of invalid taxels filled with the mean of their neighbours
    force_sd: float  #: [N]
    centre_of_pressure_sd: tuple[float, float]  #: standard deviation along x and along y [m]

    #: True if the force is a lower bound: taxels are saturated, the contact may continue in hidden taxels, or both the
    #: finger and the contact continue beyond the skin. If the finger ends at the edge of the skin, the force is
    #: complete, even if the object is larger.
    force_is_bound: bool
    centre_of_pressure_is_bound: bool  #: True if the centre is that of the measured part only

    #: True if hidden taxels or the pad's edge adjoin the contact, so that the contact may be larger. The field is also
    #: True if taxels are saturated, because a fit may then be too large.
    size_is_bound: bool
    #: Pressure gradient along x and y [Pa/m], or NaN if only part of the load is measured. On an elastic skin under an
    #: inclined face, the gradient is the stiffness of the skin times the slope of the face, however lightly the face
    #: presses.
    slope: tuple[float, float] = (np.nan, np.nan)


def contact_moments(values: np.ndarray, mask: np.ndarray, pitch: float, unit: str,
                    visibility: Visibility | None = None, noise: float | np.ndarray = np.nan) -> ContactMoments:
    """Return the moments of a contact.

    The force also counts the ring, that is, the taxels next to the contact. The outline of a contact lies where the
    taxels read half as much as inside the contact, so the ring carries a part of the load. All other moments describe
    only the taxels of the contact.

    An invalid taxel (NaN) of the contact counts as the mean of its valid neighbours in the contact. An invalid taxel
    without valid neighbours counts as the mean of the whole contact. A dead taxel therefore neither lowers the force
    nor shifts the centre of pressure. An invalid taxel of the ring counts as 0. Negative values count as 0.

    Parameters
    ----------
    values : np.ndarray
        Taxel values, float (rows, cols), with NaN for an invalid value.
    mask : np.ndarray
        Taxels of the contact, bool (rows, cols).
    pitch : float
        Distance between neighbouring taxels [m].
    unit : str
        Unit of the values: "Pa" (force = pressure times pitch²), "N" or "1" (on/off).
    visibility : Visibility or None
        Visibility of the contact, or None to compute it from ``values`` on the assumption that no taxel is saturated.
    noise : float or np.ndarray
        Standard deviation of a taxel value, as one number for all taxels or as an array (rows, cols) [unit of the
        values].

    Raises
    ------
    InputError
        Raised if the arrays have different shapes.
    ConfigurationError
        Raised if the pitch or the unit is invalid.

    Examples
    --------
    >>> contact_moments(np.full((2, 3), 1000.0), np.ones((2, 3), bool), 0.002, 'Pa').force
    0.024
    """
    if values.shape != mask.shape or values.ndim != 2:
        raise InputError('frame and contact mask', expected='the same shape (rows, cols)',
                         got=f'{values.shape} and {mask.shape}', remedy='Pass the values and the mask of one frame.')
    if unit not in VALUE_UNITS:
        raise ConfigurationError('unit of the taxel values', expected=f'one of {", ".join(VALUE_UNITS)}',
                                 got=repr(unit), remedy='Use the unit given in the skin layout.')
    check_pitch(pitch)
    if visibility is None:
        visibility = visibility_of(ContactPattern.of(mask, values))
    if not np.count_nonzero(mask):
        return _without_contact(unit, visibility.pad_seen)
    rows, cols = np.nonzero(mask)
    of_contact, filled = _filled(values, mask, rows, cols)
    if visibility.inside_hidden and filled < len(of_contact):  # hidden taxels add nothing to a lower bound
        of_contact = np.where(np.isfinite(values[mask]), of_contact, 0.0)
    total = of_contact.sum()
    share = of_contact / total if total > 0 else np.full(len(rows), np.nan)
    centre = (float(share @ cols), float(share @ rows))
    near = grown(mask)  # the contact with its ring
    y, x = np.nonzero(near)
    force_sd, deviation = _deviations(values, mask, near, of_contact, noise=np.asarray(noise, float))
    of_unit, is_bound = force_of_reading(unit, pitch), visibility.is_part
    return ContactMoments(
        force=float((total + sum_of(values, near & ~mask)) * of_unit),
        centre_of_pressure=(centre[0] * pitch, centre[1] * pitch),
        area=len(rows) * pitch**2, filled=filled, force_sd=force_sd * of_unit,
        centre_of_pressure_sd=(_centre_sd(deviation, x - centre[0], total) * pitch,
                               _centre_sd(deviation, y - centre[1], total) * pitch),
        force_is_bound=is_bound, centre_of_pressure_is_bound=is_bound,
        size_is_bound=is_bound or visibility.at_edge,
        slope=(np.nan, np.nan) if is_bound else _slope(np.where(mask, values, np.nan), of_unit / pitch**3))


def force_of_reading(unit: str, pitch: float) -> float:
    """Return the force on a taxel that reads 1 in the ``unit`` of the values [N], for a ``pitch`` in metres."""
    return {'Pa': pitch**2, 'N': 1.0, '1': np.nan}[unit]


def sum_of(values: np.ndarray, taxels: np.ndarray) -> float:
    """Return the sum of the values of some ``taxels``, in which invalid and negative values count as 0."""
    return float(np.fmax(values[taxels], 0).sum())


def _without_contact(unit: str, pad_seen: bool) -> ContactMoments:
    nan = float('nan')
    return ContactMoments(
        force=0.0 if pad_seen and unit != '1' else nan, centre_of_pressure=(nan, nan), area=0.0 if pad_seen else nan,
        filled=0, force_sd=nan, centre_of_pressure_sd=(nan, nan), force_is_bound=False,
        centre_of_pressure_is_bound=False, size_is_bound=False)


def _filled(values: np.ndarray, mask: np.ndarray, rows: np.ndarray,
            cols: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the contact's values, all >= 0, and the number of invalid taxels.

    Negative values are set to 0. Invalid taxels get the mean of their neighbours.
    """
    of_contact = np.maximum(values[mask].astype(float), 0)
    invalid = ~np.isfinite(of_contact)
    count = int(np.count_nonzero(invalid))
    if count == len(of_contact):
        return np.full(count, np.nan), count
    for i in np.flatnonzero(invalid):
        near = (np.abs(rows - rows[i]) <= 1) & (np.abs(cols - cols[i]) <= 1) & ~invalid
        of_contact[i] = of_contact[near if near.any() else ~invalid].mean()
    return of_contact, count


def _deviations(values: np.ndarray, mask: np.ndarray, near: np.ndarray, of_contact: np.ndarray, *,
                noise: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the standard deviation of the sum over a contact and its ring, and of each taxel's share in the contact.

    ``near`` marks the taxels of the contact and of its ring. One part of a standard deviation is the noise of the
    values. The other part arises because a taxel near its threshold may belong to the contact in one frame and not in
    the next. The sum counts such a taxel in both frames, so its standard deviation does not contain this part. The
    thresholds are estimated from the lowest reading in the contact and the highest reading in the ring. Because of
    hysteresis, a taxel leaves the contact at or below the smaller of these two readings, and a taxel of the ring enters
    the contact at or above the larger one.

    A filled taxel is given the variance of the contact's values. An invalid taxel in the ring is assumed to be pressed
    or not pressed with equal probability.
    """
    inside, read, own = mask[near], values[near], noise[near] if noise.ndim else noise
    known = np.isfinite(read)
    level = np.where(known, np.maximum(read, 0), 0.0)
    ends = level[inside & known].min(initial=np.inf), level[~inside].max(initial=0.0)
    margin = np.where(inside, level - min(ends), max(ends) - level)
    with np.errstate(divide='ignore', invalid='ignore'):
        other = ndtr(-margin / own)  # probability that the taxel is on the other side of its threshold
    variance = np.zeros(len(read))
    if not known.all():
        variance[~known] = np.where(inside, of_contact.var(), of_contact.mean()**2 / 4)[~known]
    of_sum = float(np.sqrt((variance + own**2).sum()))
    variance += np.where(inside, own**2, 0.0) + np.where(own > 0, other * (1 - other) * level**2, own)
    return of_sum, np.sqrt(variance)


def _centre_sd(deviation: np.ndarray, offset: np.ndarray, total: float) -> float:
    """Return the standard deviation of a weighted mean of positions.

    The derivative of the mean with respect to a weight is the ``offset`` of the position from the mean, divided by
    ``total``.
    """
    weighted = deviation * offset
    return float(np.sqrt(weighted @ weighted) / total) if total > 0 else float('nan')


def _slope(inside: np.ndarray, of_unit: float) -> tuple[float, float]:
    """Return the mean difference between neighbouring taxels, times ``of_unit``, along x and along y.

    The mean is NaN if there are too few pairs. Only the middle third of the sorted differences is used, because the
    object covers taxels at the edge of the contact only in part.
    """
    found = []
    for differences in (inside[:, 1:] - inside[:, :-1], inside[1:] - inside[:-1]):
        known = np.sort(differences[np.isfinite(differences)])
        third = len(known) // 3
        found.append(float(known[third:len(known) - third].mean() * of_unit) if len(known) >= LEAST_PAIRS else np.nan)
    return found[0], found[1]


def principal_axis(mask: np.ndarray) -> float:
    """Return the direction of the longer axis of a contact, positive from x to y, in (-π/2, π/2] [rad].

    ``mask`` is bool (rows, cols). The direction is NaN for a round contact and without a contact.
    """
    y, x = np.nonzero(mask)
    if not len(x):
        return float('nan')
    dx, dy = x - x.sum() / len(x), y - y.sum() / len(y)
    xx, yy, mixed = dx @ dx, dy @ dy, 2 * (dx @ dy)
    if np.hypot(xx - yy, mixed) <= ROUND_DIFFERENCE * (xx + yy):
        return float('nan')
    axis = np.arctan2(mixed, xx - yy) / 2
    return float(axis if axis > -np.pi / 2 else np.pi / 2)
