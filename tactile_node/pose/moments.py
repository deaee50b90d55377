"""What taxel values give whatever the shape: force, centre of pressure, contact area, principal axis."""

from typing import NamedTuple

import numpy as np

from tactile_node.errors import ConfigurationError, InputError
from tactile_node.pose.pitch import check_pitch

UNITS = ('Pa', 'N', '1')
ROUND = 0.02  #: relative difference of the two second moments below which no axis is the longer one


class ContactMoments(NamedTuple):
    """Of one contact, in the pad's frame; NaN where undefined."""

    force: float                             #: sum of the taxels' forces [N]; NaN for an on/off skin
    centre_of_pressure: tuple[float, float]  #: [m]
    area: float                              #: taxels of the contact, invalid ones too, times pitch² [m²]
    principal_axis: float                    #: of the contact's area, x to y, in (-π/2, π/2] [rad]
    filled: int                              #: invalid taxels, taken as the mean of their neighbours


def contact_moments(values: np.ndarray, mask: np.ndarray, pitch: float, unit: str) -> ContactMoments:
    """Return the moments of the contact ``mask`` (bool) of a frame ``values``, both (rows, cols).

    ``pitch`` [m]; ``unit`` of the values: "Pa" (force = pressure times pitch²), "N" or "1" (on/off). An
    invalid taxel (NaN) of the contact counts with the mean of its valid neighbours in the contact, or else
    of the whole contact, so that a dead taxel neither lowers the force nor shifts its centre. Negative values
    count as 0. Raises InputError for shapes that differ, ConfigurationError for pitch or unit.

    >>> contact_moments(np.full((2, 3), 1000.0), np.ones((2, 3), bool), 0.002, 'Pa').force
    0.024
    """
    _check(values, mask, pitch, unit)
    if not mask.any():
        nan = float('nan')
        return ContactMoments(force=nan if unit == '1' else 0.0, centre_of_pressure=(nan, nan), area=0.0,
                              principal_axis=nan, filled=0)
    rows, cols = np.nonzero(mask)
    of_contact, filled = _filled(values, mask, rows, cols)
    total = of_contact.sum()
    force = {'Pa': total * pitch**2, 'N': total, '1': np.nan}[unit]
    share = of_contact / total if total > 0 else np.full(len(rows), np.nan)
    centre = (float(share @ cols * pitch), float(share @ rows * pitch))
    return ContactMoments(force=float(force), centre_of_pressure=centre, area=len(rows) * pitch**2,
                          principal_axis=_principal_axis(cols, rows), filled=filled)


def _check(values: np.ndarray, mask: np.ndarray, pitch: float, unit: str) -> None:
    if values.shape != mask.shape or values.ndim != 2:
        raise InputError('frame and contact mask', expected='one shape (rows, cols)',
                         got=f'{values.shape} and {mask.shape}', remedy='Pass both of one frame.')
    if unit not in UNITS:
        raise ConfigurationError('unit of the taxel values', expected=f'one of {", ".join(UNITS)}',
                                 got=repr(unit), remedy='Give the unit that the skin layout gives.')
    check_pitch(pitch)


def _filled(values: np.ndarray, mask: np.ndarray, rows: np.ndarray,
            cols: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the contact's values >= 0 with invalid ones replaced, and how many those are."""
    of_contact = np.maximum(values[mask].astype(float), 0)
    invalid = ~np.isfinite(of_contact)
    if invalid.all():
        return np.zeros(len(of_contact)), len(of_contact)
    mean = of_contact[~invalid].mean()
    for i in np.flatnonzero(invalid):
        near = (np.abs(rows - rows[i]) <= 1) & (np.abs(cols - cols[i]) <= 1) & ~invalid
        of_contact[i] = of_contact[near].mean() if near.any() else mean
    return of_contact, int(invalid.sum())


def _principal_axis(x: np.ndarray, y: np.ndarray) -> float:
    dx, dy = x - x.mean(), y - y.mean()
    difference, mixed, total = dx @ dx - dy @ dy, 2 * (dx @ dy), dx @ dx + dy @ dy
    if np.hypot(difference, mixed) <= ROUND * total:
        return float('nan')
    axis = np.arctan2(mixed, difference) / 2
    return float(axis if axis > -np.pi / 2 else np.pi / 2)
