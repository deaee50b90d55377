"""Tare: the reading of each taxel with nothing on it, measured and taken off."""

import threading
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tactile_node.conditioning.drift import DriftFollower
from tactile_node.errors import HalfZeroedError, TareRefusedError
from tactile_node.frames.taxel_frame import TaxelFrame, TaxelStatus, without_any_value
from tactile_node.read_only import read_only

LOST_ZERO = 'its device has started anew since it zeroed itself'
FAULTY = (TaxelStatus.DEAD, TaxelStatus.FAULTY)
SETTLING = 3  #: frames given up after a device has zeroed itself: some were under way


class Tare(NamedTuple):
    """Zero of a pad; in the taxels' unit."""

    offset: np.ndarray  #: float32, (rows, cols), read-only; 0 for a taxel that had no valid value
    frames: int         #: averaged
    noise: float        #: standard deviation of a taxel around its zero, root mean square over the pad
    known: np.ndarray   #: bool, (rows, cols): where the offset was measured

    @property
    def largest(self) -> float:
        """The offset farthest from 0."""
        return float(self.offset.flat[np.abs(self.offset).argmax()])


def measure(values: np.ndarray, limit: float) -> Tare:
    """Return the zero of a pad from frames without a tare, (K, rows, cols), NaN where invalid.

    Raises TareRefusedError where something presses: a taxel reads ``limit`` or more, or varies by as much. And
    where not one taxel has a valid value in all frames.
    """
    known = np.isfinite(values).all(0)
    if not known.any():
        raise TareRefusedError('tare', expected='taxels with valid values', got='none',
                               remedy='See /diagnostics: do all CAN frames of the pad arrive?')
    mean = np.where(known, values.mean(0), 0)
    varies = np.where(known, np.ptp(np.where(known, values, 0), axis=0), 0)
    worst = np.maximum(mean, varies)
    if (worst >= limit).any():
        row, col = np.unravel_index(worst.argmax(), worst.shape)
        raise TareRefusedError(
            'tare', expected=f'nothing on the pad: all taxels below {limit:g}, and steady',
            got=f'{np.count_nonzero(worst >= limit)} taxels above, most at row {row}, column {col}: mean '
                f'{mean[row, col]:g}, varying by {varies[row, col]:g}',
            remedy='Open the gripper. If nothing presses: set "offset" in the layout, or raise tare_limit.')
    return Tare(read_only(mean.astype(np.float32)), len(values), float(np.sqrt(values.var(0)[known].mean())), known)


class TaredPad:
    """Takes the zero of one pad off its frames; frames come on one thread, ``tare`` is called on another.

    With ``drift`` the zero follows the taxels while nothing presses.

    >>> pad = TaredPad()
    >>> pad.offset is None
    True
    """

    def __init__(self, drift: DriftFollower | None = None):
        self.offset: np.ndarray | None = None
        self._doubt, self._is_device_zero_kept = '', lambda: True
        self.drift = drift
        self._wanted, self._taken, self._changed = 0, [], threading.Condition()
        self._ended = ''  # why no more frames come, '' while they may

    @property
    def doubt(self) -> str:
        """Why the zero is unknown, so that no value is valid; '' while it is known."""
        return self._doubt or ('' if self._is_device_zero_kept() else LOST_ZERO)

    def feed(self, frame: TaxelFrame) -> TaxelFrame:
        """Return the frame, its tare taken off."""
        doubt = self.doubt
        with self._changed:
            if self._wanted and not frame.missing_can_frames:
                self._taken.append(frame.values)
                self._wanted -= 1
                self._changed.notify()
            if (drift := self.drift) is not None and not doubt:
                zero = np.zeros_like(frame.values) if self.offset is None else self.offset
                self.offset = drift.update(frame.stamp, frame.values, zero, np.isin(frame.status, FAULTY))
        if doubt:
            return without_any_value(frame)
        if self.offset is None:
            return frame
        return frame._replace(values=read_only((frame.values - self.offset).astype(np.float32, copy=False)))

    def tare(self, frames: int, limit: float, timeout: float) -> Tare:
        """Average the next whole ``frames`` into a new tare; TareRefusedError, also after ``timeout`` [s]."""
        found = self.measure_next(frames, limit, timeout)
        with self._changed:  # a taxel that could not be measured keeps its zero
            offset = found.offset if self.offset is None else np.where(found.known, found.offset, self.offset)
            self.offset = read_only(offset)
            self._doubt, self._is_device_zero_kept = '', lambda: True
        return found

    def tare_after(self, zero_device: Callable[[], int], is_kept: Callable[[], bool], frames: int, limit: float,
                   timeout: float) -> tuple[int, Tare]:
        """Let the device zero itself, then take off what is left; return what ``zero_device`` does, too.

        Refused under load before the device is asked, or it would take the load for its zero. Until the new tare is
        known no value is valid. From then on ``is_kept`` tells whether the device still has its zero (CiA 404: after a
        reset it has not, unless it was told to save it); once it has not, no value is valid before the next tare.
        When ``zero_device`` raises all is as before, but for HalfZeroedError: then no value is valid.
        """
        self.measure_next(frames, limit, timeout)
        before = self._doubt, self.offset
        with self._changed:
            self._doubt, self.offset = 'its device is zeroing itself', None
        try:
            zeroed = zero_device()
        except HalfZeroedError as error:
            self._doubt = f'its device has zeroed itself in part: {error}'
            raise
        except BaseException:
            with self._changed:
                self._doubt, self.offset = before
            raise
        try:
            self.measure_next(SETTLING, np.inf, timeout)
            return zeroed, self.tare(frames, limit, timeout)
        finally:
            self._doubt, self._is_device_zero_kept = '', is_kept

    def give_up(self, why: str) -> None:
        """No frames come until ``expect``: whoever waits for some is refused at once."""
        with self._changed:
            self._ended = why
            self._changed.notify()

    def expect(self) -> None:
        """Frames come again."""
        self._ended = ''

    def measure_next(self, frames: int, limit: float, timeout: float) -> Tare:
        """As ``tare``, but only measure."""
        with self._changed:
            self._taken, self._wanted = [], frames
            self._changed.wait_for(lambda: not self._wanted or self._ended, timeout)
            taken, self._taken, self._wanted = self._taken, [], 0
        if len(taken) < frames and self._ended:
            raise TareRefusedError('tare', expected='a driver that is active', got=self._ended,
                                   remedy='Activate it and ask again.')
        if len(taken) < frames:
            raise TareRefusedError('tare', expected=f'{frames} whole taxel frames within {timeout:.1f} s',
                                   got=f'{len(taken)}', remedy='See /diagnostics: it says what is lost.')
        return measure(np.stack(taken), limit)
