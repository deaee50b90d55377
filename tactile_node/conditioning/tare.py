"""Tare: the reading of each taxel with nothing on it, measured and subtracted."""

import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.ndimage import label

from tactile_node.code_names import PhrasedCode
from tactile_node.conditioning.drift import DriftFollower
from tactile_node.errors import ConfigurationError, HalfZeroedError, TareRefusal, TareRefusedError
from tactile_node.taxel_frame import (
    ON_OFF_UNIT,
    PRESS_BY_UNIT,
    RELEASE_RATIO,
    TaxelFrame,
    TaxelStatus,
    read_only,
    without_any_value,
)

#: A taxel that reads so much is pressed when a tare is requested: less than a contact worth the name.
TARE_LIMIT_BY_UNIT = {'Pa': 10e3, 'N': 0.03}


def tare_limit(given: float, unit: str) -> float:
    """Return ``given``, or where it is 0 the limit for ``unit``. Raises ConfigurationError where there is none."""
    limit = None if unit == ON_OFF_UNIT else given or TARE_LIMIT_BY_UNIT.get(unit)
    if limit is None:
        raise ConfigurationError('tare', expected='taxels in ' + ' or '.join(TARE_LIMIT_BY_UNIT), got=repr(unit),
                                 remedy='On/off taxels have no zero to set.')
    return limit


def rest_limit(given: float, unit: str) -> float:
    """Return the same for on/off taxels too: below it a taxel is not pressed."""
    return PRESS_BY_UNIT[ON_OFF_UNIT] if unit == ON_OFF_UNIT else tare_limit(given, unit)


def drift_limit(given: float, unit: str, gains: np.ndarray | None = None) -> float:
    """Return what the zero may be followed by: a ``given`` tare limit beyond the unit's own would hide a grasp.

    So would one that the largest of ``gains`` makes a contact of. Raises ConfigurationError where there is no zero.
    """
    largest = 1.0 if gains is None else max(1.0, float(gains.max()))
    return min(tare_limit(given, unit), tare_limit(0.0, unit)) / largest


RAISED_TAXELS = 3  #: connected taxels that stand out make a contact; fewer may be faulty


class ContactGuard(NamedTuple):
    """Finds a contact in readings. Levels are of published values: gain x (reading - zero).

    A taxel is pressed from ``press`` on, and until it reads less than RELEASE_RATIO of it: the processor, by its
    defaults, reports such a contact. RAISED_TAXELS connected taxels are pressed too where they read ``raised`` more
    than the pad's background, and more than its offsets vary: before the first tare a contact may hide in a low offset.
    """

    press: float
    raised: float
    unit: str  #: unit of the taxels
    gains: np.ndarray | float = 1.0  #: (rows, cols) or one for all

    @classmethod
    def of_unit(cls, unit: str, gains: np.ndarray | float = 1.0) -> 'ContactGuard':
        """``unit``: of the taxels, one of PRESS_BY_UNIT."""
        return cls(PRESS_BY_UNIT[unit], TARE_LIMIT_BY_UNIT.get(unit, np.inf), unit, gains)

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
        # an object may cover three quarters; the distance is 0.97 standard deviations of normal offsets, six are none
        lowest, background = np.quantile(mean[known], (0.05, 0.25))
        raised = known & (mean >= background + max(self.raised, 6 * (background - lowest)))
        groups, count = label(raised, np.ones((3, 3)))
        sizes = np.bincount(groups.ravel(), minlength=count + 1)
        sizes[0] = 0
        return (sizes >= RAISED_TAXELS)[groups]


class ZeroState(PhrasedCode):
    """Whether the zero of a pad is valid: subtracted here, or as the device sends it; if not, why."""

    NOT_KNOWN = 0, 'the state of its zero is not known'
    VALID = 1, 'its zero is valid'
    DEVICE_IS_ZEROING = 2, 'its device is zeroing itself'
    DEVICE_PARTLY_ZEROED = 3, 'its device has zeroed itself in part'
    DEVICE_HAS_RESTARTED = 4, 'its device has restarted since it zeroed itself'
    DEVICE_NOT_CHECKED = 5, 'its device has zeroed itself, and the tare that checks it has failed'


class Tare(NamedTuple):
    """Zero of a pad."""

    offset: np.ndarray  #: float32, (rows, cols), read-only; 0 for a taxel that had no valid value
    frames: int         #: averaged
    noise: float        #: standard deviation of a taxel around its zero, root mean square over the pad
    known: np.ndarray   #: bool, (rows, cols): where the offset was measured
    unit: str           #: unit of offset and noise

    @property
    def largest(self) -> float:
        """The offset farthest from 0."""
        return float(self.offset.flat[np.abs(self.offset).argmax()])


def measure(values: np.ndarray, limit: float, guard: ContactGuard, zero: np.ndarray | float = 0.0) -> Tare:
    """Return the zero of a pad from frames without a tare, (K, rows, cols), NaN where invalid.

    Raises TareRefusedError where something presses: a taxel reads ``limit`` or more, or varies by as much, or
    ``guard`` finds a contact over the present ``zero``. And where not one taxel has a valid value in all frames.
    """
    known = np.isfinite(values).all(0)
    if not known.any():
        raise TareRefusedError('tare', TareRefusal.NO_VALID_VALUES, expected='taxels with valid values', got='none',
                               remedy='See /diagnostics: do all CAN frames of the pad arrive?')
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
            remedy='Open the gripper. If nothing presses: set "offset" in the layout, or raise tare_limit.')
    _refuse_contact(values, guard, zero)
    noise = float(np.sqrt(values.var(0)[known].mean()))
    return Tare(read_only(mean.astype(np.float32)), len(values), noise, known, guard.unit)


def _refuse_contact(values: np.ndarray, guard: ContactGuard, zero: np.ndarray | float) -> None:
    """Raise TareRefusedError where ``guard`` finds a contact."""
    pressed = guard.pressed(values, zero)
    if pressed.any():
        loads = np.where(pressed, np.where(np.isfinite(values), values - zero, -np.inf).max(0), -np.inf)
        row, col = np.unravel_index(loads.argmax(), loads.shape)
        raise TareRefusedError(
            'tare', TareRefusal.CONTACT, expected='no contact on the pad, whatever tare_limit is',
            got=f'{np.count_nonzero(pressed)} pressed taxels, most at row {row}, column {col}: {loads[row, col]:g} '
                f'{guard.unit} above zero',
            remedy='Open the gripper. If nothing presses: set "offset" in the layout, or take out faulty taxels.')


class TaredPad:
    """Subtracts the zero of one pad from its frames; frames come on one thread, ``tare`` is called on another.

    ``guard`` finds the contacts that are never tared away. With ``drift`` the zero follows the taxels while nothing
    presses.

    >>> pad = TaredPad(ContactGuard.of_unit('Pa'))
    >>> pad.offset is None
    True
    """

    def __init__(self, guard: ContactGuard, drift: DriftFollower | None = None):
        self.offset: np.ndarray | None = None
        self.drift = drift
        self.zero_error: HalfZeroedError | None = None  #: what the device reported, when it is PARTLY_ZEROED
        self._guard = guard
        self._zero_state = ZeroState.VALID
        self._boots: Callable[[], int] | None = None  # counted, where a device has zeroed itself
        self._zeroed_after = 0  # so many boots
        self._wanted = 0
        self._taken: list[np.ndarray] = []
        self._changed = threading.Condition()
        self._ended = ''  # why no more frames come, '' while they may

    @property
    def zero_state(self) -> ZeroState:
        """Whether the zero is valid; while it is not, no value is."""
        if self._zero_state is ZeroState.VALID and self._boots is not None and self._boots() != self._zeroed_after:
            return ZeroState.DEVICE_HAS_RESTARTED
        return self._zero_state

    def feed(self, frame: TaxelFrame) -> TaxelFrame:
        """Return the frame, its tare subtracted."""
        is_valid = self.zero_state is ZeroState.VALID
        with self._changed:
            if self._wanted and not frame.missing_can_frames:
                self._taken.append(frame.values)
                self._wanted -= 1
                self._changed.notify()
            if (drift := self.drift) is not None and is_valid:
                zero = np.zeros_like(frame.values) if self.offset is None else self.offset
                is_contact = bool(self._guard.pressed(frame.values[np.newaxis], zero).any())
                is_faulty = np.isin(frame.status, (TaxelStatus.DEAD, TaxelStatus.FAULTY))
                self.offset = drift.update(frame.stamp, frame.values, zero, is_faulty, is_contact)
        if not is_valid:
            return without_any_value(frame)
        if self.offset is None:
            return frame
        return frame._replace(values=read_only((frame.values - self.offset).astype(np.float32, copy=False)))

    def tare(self, frames: int, limit: float, timeout: float) -> Tare:
        """Average the next complete ``frames`` into a new tare; TareRefusedError, also after ``timeout`` [s]."""
        boots = self._boots() if self._boots is not None else 0
        found = self._measure_next(frames, limit, timeout)
        with self._changed:  # a taxel that could not be measured keeps its zero
            offset = found.offset if self.offset is None else np.where(found.known, found.offset, self.offset)
            self.offset = read_only(offset)
            self._zeroed_after = boots
            self._zero_state = ZeroState.VALID
        return found

    def tare_after(self, zero_device: Callable[[], int], boots: Callable[[], int], frames: int, limit: float,
                   timeout: float) -> tuple[int, Tare]:
        """Let the device zero itself, then subtract what is left; return the result of ``zero_device``, too.

        Refused under load before the device receives the request, or it would take the load for its zero. Until the
        new tare is known no value is valid, also when it fails. From then on ``boots``, which counts the boot-ups of
        the device, shows whether it still has its zero (CiA 404: after a reset it has not, unless it was commanded to
        save it); once it has not, no value is valid before the next tare. When ``zero_device`` raises, all is as
        before; after HalfZeroedError no value is valid.
        """
        self._measure_next(frames, limit, timeout)
        before = self._zero_state, self.offset, self._boots
        with self._changed:
            self._zero_state, self.offset, self._boots = ZeroState.DEVICE_IS_ZEROING, None, boots
        try:
            zeroed = zero_device()
        except HalfZeroedError as error:
            self.zero_error = error
            self._zero_state = ZeroState.DEVICE_PARTLY_ZEROED
            raise
        except BaseException:
            with self._changed:
                self._zero_state, self.offset, self._boots = before
            raise
        try:
            self._take_next(3, timeout)  # some were under way
            return zeroed, self.tare(frames, limit, timeout)
        except BaseException:
            self._zero_state = ZeroState.DEVICE_NOT_CHECKED
            raise

    def give_up(self, why: str) -> None:
        """No frames come until ``expect``: any tare that waits for some is refused at once."""
        with self._changed:
            self._ended = why
            self._changed.notify()

    def expect(self) -> None:
        """Frames come again."""
        self._ended = ''

    def _measure_next(self, frames: int, limit: float, timeout: float) -> Tare:
        """Measure as ``tare`` does, but change nothing."""
        taken = self._take_next(frames, timeout)
        return measure(taken, limit, self._guard, 0.0 if self.offset is None else self.offset)

    def _take_next(self, frames: int, timeout: float) -> np.ndarray:
        """Return the values of the next complete ``frames``, (frames, rows, cols); TareRefusedError."""
        with self._changed:
            self._taken, self._wanted = [], frames
            self._changed.wait_for(lambda: not self._wanted or self._ended, timeout)
            taken = self._taken
            self._taken, self._wanted = [], 0
        if len(taken) < frames and self._ended:
            raise TareRefusedError('tare', TareRefusal.DRIVER_NOT_ACTIVE, expected='a driver that is active',
                                   got=self._ended, remedy='Activate it and request the tare again.')
        if len(taken) < frames:
            raise TareRefusedError('tare', TareRefusal.TOO_FEW_FRAMES, got=f'{len(taken)}',
                                   expected=f'{frames} whole taxel frames within {timeout:.1f} s',
                                   remedy='See /diagnostics: it names the losses.')
        return np.stack(taken)
