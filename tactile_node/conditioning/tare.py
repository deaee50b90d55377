"""Measure the zero of a pad, which is the reading of each taxel while nothing touches the pad."""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import label

from tactile_node.errors import ConfigurationError, TareRefusal, TareRefusedError
from tactile_node.taxel_frame import ON_OFF_UNIT, PRESS_BY_UNIT, RELEASE_RATIO, read_only

#: If a taxel reads this value or more when a tare is requested, it is pressed. The value is lower than the readings of
#: a real contact.
TARE_LIMIT_BY_UNIT = {'Pa': 10e3, 'N': 0.03}


def tare_limit(given: float, unit: str) -> float:
    """Return ``given``, or the tare limit for ``unit`` if ``given`` is 0.

    Raises
    ------
    ConfigurationError
        Raised if there is no tare limit for taxels in this unit.
    """
    limit = None if unit == ON_OFF_UNIT else given or TARE_LIMIT_BY_UNIT.get(unit)
    if limit is None:
        raise ConfigurationError('tare', expected='taxels in ' + ' or '.join(TARE_LIMIT_BY_UNIT), got=repr(unit),
                                 remedy='On/off taxels have no zero to set.')
    return limit


def rest_limit(given: float, unit: str) -> float:
    """Return the value below which a taxel is not pressed.

    The value is the tare limit, or the press threshold for on/off taxels.
    """
    return PRESS_BY_UNIT[ON_OFF_UNIT] if unit == ON_OFF_UNIT else tare_limit(given, unit)


def drift_limit(given: float, unit: str, gains: np.ndarray | None = None) -> float:
    """Return the largest drift that the zero may follow.

    If ``given`` is above the tare limit of the unit, the zero could hide a grasp. If the largest of ``gains`` amplifies
    a zero error above the contact threshold, the error looks like a contact. The result is therefore the lower of both
    tare limits, divided by the largest gain if that is above 1.

    Parameters
    ----------
    given : float
        Tare limit from the configuration; 0 if none is given.
    unit : str
        Unit of the taxels.
    gains : np.ndarray or None
        Gain of each taxel.

    Raises
    ------
    ConfigurationError
        Raised if taxels in this unit have no zero.
    """
    largest = 1.0 if gains is None else max(1.0, float(gains.max()))
    return min(tare_limit(given, unit), tare_limit(0.0, unit)) / largest


#: Smallest number of connected raised taxels that form a contact. A smaller group may consist of faulty taxels.
RAISED_TAXELS = 3


class ContactGuard(NamedTuple):
    """Finds a contact in readings. The thresholds apply to published values: gain x (reading - zero).

    A taxel becomes pressed at ``press`` and is released below RELEASE_RATIO x ``press``. With its default settings, the
    processor reports the same contacts.

    A group of RAISED_TAXELS connected taxels is also pressed if the taxels read ``raised`` above the background of the
    pad. The raised taxels must also exceed the variation of the pad's offsets, because a low offset may hide a contact
    before the first tare.
    """

    press: float                     #: press threshold
    raised: float                    #: required rise above the background of the pad
    unit: str                        #: unit of the taxels
    gains: np.ndarray | float = 1.0  #: (rows, cols), or one gain for all taxels

    @classmethod
    def of_unit(cls, unit: str, gains: np.ndarray | float = 1.0) -> 'ContactGuard':
        """Return the guard for taxels in ``unit``, which must be one of PRESS_BY_UNIT."""
        return cls(PRESS_BY_UNIT[unit], TARE_LIMIT_BY_UNIT.get(unit, np.inf), unit, gains)

    def pressed(self, readings: np.ndarray, zero: np.ndarray | float) -> np.ndarray:
        """Return the taxels that are pressed in any of several successive frames.

        Parameters
        ----------
        readings : np.ndarray
            Readings of K frames, (K, rows, cols); NaN if invalid.
        zero : np.ndarray or float
            Zero of each taxel, or one zero for all taxels.

        Returns
        -------
        np.ndarray
            bool (rows, cols).

        Examples
        --------
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
        # An object may cover three quarters of the pad, so the lowest quarter shows the background. If offsets are
        # normally distributed, the two quantiles are 0.97 standard deviations apart, and no offset deviates by six
        # times that distance.
        lowest, background = np.quantile(mean[known], (0.05, 0.25))
        raised = known & (mean >= background + max(self.raised, 6 * (background - lowest)))
        groups, count = label(raised, np.ones((3, 3)))
        sizes = np.bincount(groups.ravel(), minlength=count + 1)
        sizes[0] = 0
        return (sizes >= RAISED_TAXELS)[groups]


class Tare(NamedTuple):
    """The zero of a pad."""

    offset: np.ndarray  #: float32, (rows, cols), read-only; 0 for a taxel without a valid value
    frames: int         #: number of frames averaged
    noise: float        #: standard deviation of a taxel's reading around its zero, as the root mean square over the pad
    known: np.ndarray   #: bool (rows, cols), True where the offset was measured
    unit: str           #: unit of offset and noise

    @property
    def largest(self) -> float:
        """Offset that is farthest from 0."""
        return float(self.offset.flat[np.abs(self.offset).argmax()])


def measure(values: np.ndarray, limit: float, guard: ContactGuard, zero: np.ndarray | float = 0.0) -> Tare:
    """Return the zero of a pad.

    Parameters
    ----------
    values : np.ndarray
        Values of K frames before any tare, (K, rows, cols); NaN if invalid.
    limit : float
        Reading at and above which a taxel counts as pressed.
    guard : ContactGuard
        Guard that finds contacts, which a tare must not remove.
    zero : np.ndarray or float
        Present zero.

    Raises
    ------
    TareRefusedError
        Raised if a taxel reads ``limit`` or more or varies by as much, if ``guard`` finds a contact, or if no taxel has
        a valid value in all frames.
    """
    known = np.isfinite(values).all(0)
    if not known.any():
        raise TareRefusedError('tare', TareRefusal.NO_VALID_VALUES, expected='taxels with valid values', got='none',
                               remedy='Check in /diagnostics that all CAN frames of the pad arrive.')
    mean = np.where(known, values.mean(0), 0)
    varies = np.where(known, np.ptp(np.where(known, values, 0), axis=0), 0)
    worst = np.maximum(mean, varies)
    if (worst >= limit).any():
        row, col = np.unravel_index(worst.argmax(), worst.shape)
        raise TareRefusedError(
            'tare', TareRefusal.PRESSED,
            expected=f'nothing on the pad: all taxels below {limit:g} {guard.unit}, and steady',
            got=f'{np.count_nonzero(worst >= limit)} taxels above, most at row {row}, column {col}: mean '
                f'{mean[row, col]:g} {guard.unit}, varying by {varies[row, col]:g} {guard.unit}',
            remedy='Open the gripper. If nothing presses the pad, set "offset" in the layout or raise tare_limit. If '
                   'many taxels vary, check "bits", "signed" and "byte_order" in the layout with `tactile check`.')
    _refuse_contact(values, guard, zero)
    noise = float(np.sqrt(values.var(0)[known].mean()))
    return Tare(read_only(mean.astype(np.float32)), len(values), noise, known, guard.unit)


def _refuse_contact(values: np.ndarray, guard: ContactGuard, zero: np.ndarray | float) -> None:
    """Raise TareRefusedError if ``guard`` finds a contact."""
    pressed = guard.pressed(values, zero)
    if pressed.any():
        loads = np.where(pressed, np.where(np.isfinite(values), values - zero, -np.inf).max(0), -np.inf)
        row, col = np.unravel_index(loads.argmax(), loads.shape)
        raise TareRefusedError(
            'tare', TareRefusal.CONTACT, expected='no contact on the pad, at any tare_limit',
            got=f'{np.count_nonzero(pressed)} pressed taxels, most at row {row}, column {col}: {loads[row, col]:g} '
                f'{guard.unit} above zero',
            remedy='Open the gripper. If nothing presses the pad, set "offset" in the layout or exclude faulty taxels.')
