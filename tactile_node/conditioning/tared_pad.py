"""Subtract the zero of a pad from its frames, and tare the pad."""

import threading
from collections.abc import Callable

import numpy as np

from tactile_node.code_names import PhrasedCode
from tactile_node.conditioning.drift import DriftFollower
from tactile_node.conditioning.tare import ContactGuard, Tare, measure
from tactile_node.errors import HalfZeroedError, TareRefusal, TareRefusedError
from tactile_node.taxel_frame import TaxelFrame, TaxelStatus, read_only


class ZeroState(PhrasedCode):
    """State of a pad's zero, whether the driver or the device subtracts the zero."""

    NOT_KNOWN = 0, 'the state of its zero is not known'
    VALID = 1, 'its zero is valid'
    DEVICE_IS_ZEROING = 2, 'its device is zeroing itself'
    DEVICE_PARTLY_ZEROED = 3, 'its device has zeroed itself in part'
    DEVICE_HAS_RESTARTED = 4, 'its device has restarted since it zeroed itself'
    DEVICE_NOT_CHECKED = 5, 'its device has zeroed itself, and the tare that checks it has failed'


class TaredPad:
    """Subtracts the zero of one pad from its frames. Frames arrive on one thread, while `tare` is called on another.

    Parameters
    ----------
    guard : ContactGuard
        Guard that finds contacts, which a tare never removes.
    drift : DriftFollower or None
        Follower that lets the zero drift with the taxels while nothing presses them; None to hold the zero.

    Examples
    --------
    >>> pad = TaredPad(ContactGuard.of_unit('Pa'))
    >>> pad.offset is None
    True
    """

    def __init__(self, guard: ContactGuard, drift: DriftFollower | None = None):
        self.offset: np.ndarray | None = None
        self.drift = drift
        self.zero_error: HalfZeroedError | None = None  #: error of a device that has zeroed only some of its channels
        self._guard = guard
        self._zero_state = ZeroState.VALID
        self._boots: Callable[[], int] | None = None  # function that counts boot-ups of a device that has zeroed itself
        self._zeroed_after = 0  # number of boot-ups counted when the device zeroed itself
        self._wanted = 0
        self._taken: list[np.ndarray] = []
        self._changed = threading.Condition()
        self._ended = ''  # reason why no more frames arrive; '' while frames may arrive

    @property
    def zero_state(self) -> ZeroState:
        """State of the zero. Values are valid only in the state VALID."""
        if self._zero_state is ZeroState.VALID and self._boots is not None and self._boots() != self._zeroed_after:
            return ZeroState.DEVICE_HAS_RESTARTED
        return self._zero_state

    def feed(self, frame: TaxelFrame) -> TaxelFrame:
        """Return the frame with the zero subtracted."""
        with self._changed:  # the state and the zero must belong together
            is_valid = self.zero_state is ZeroState.VALID
            if self._wanted and not frame.missing_can_frames:
                self._taken.append(frame.values)
                self._wanted -= 1
                self._changed.notify()
            if (drift := self.drift) is not None and is_valid:
                zero = np.zeros_like(frame.values) if self.offset is None else self.offset
                is_contact = bool(self._guard.pressed(frame.values[np.newaxis], zero).any())
                is_faulty = np.isin(frame.status, (TaxelStatus.DEAD, TaxelStatus.FAULTY))
                self.offset = drift.update(frame.stamp, frame.values, zero, is_faulty, is_contact)
            offset = self.offset
        if not is_valid:
            return frame.without(frame.has_value)
        if offset is None:
            return frame
        return frame._replace(values=read_only((frame.values - offset).astype(np.float32, copy=False)))

    def tare(self, frames: int, limit: float, timeout: float) -> Tare:
        """Average the next complete frames to obtain a new zero.

        Parameters
        ----------
        frames : int
            Number of frames to average.
        limit : float
            Reading at and above which a taxel counts as pressed.
        timeout : float
            Time allowed for the frames to arrive [s].

        Raises
        ------
        TareRefusedError
            Raised if the pad is pressed or the frames do not arrive in time.
        """
        boots = self._boots() if self._boots is not None else 0
        found = self._measure_next(frames, limit, timeout)
        with self._changed:  # a taxel that could not be measured keeps its previous zero
            offset = found.offset if self.offset is None else np.where(found.known, found.offset, self.offset)
            self.offset = read_only(offset)
            self._zeroed_after = boots
            self._zero_state = ZeroState.VALID
        return found

    def tare_after(self, zero_device: Callable[[], int], boots: Callable[[], int], frames: int, limit: float,
                   timeout: float) -> tuple[int, Tare]:
        """Command the device to zero itself, then subtract the remaining offset.

        If the pad is under load, the request is refused before it reaches the device, because the device would store
        the load as its zero. After the command, no value is valid until the new tare is known, even if the tare fails.

        After the tare, ``boots`` shows whether the device still has its zero. According to CiA 404, a reset erases the
        zero of a device unless the device was commanded to save it. Once the device has lost its zero, no value is
        valid until the next tare.

        If ``zero_device`` raises an error, the previous state is restored. After a HalfZeroedError, however, no value
        is valid.

        Parameters
        ----------
        zero_device : callable
            Function that commands the device to zero itself and returns the number of zeroed channels.
        boots : callable
            Function that returns the number of boot-ups of the device.
        frames, limit, timeout
            As for `tare`.

        Returns
        -------
        zeroed : int
            Result of ``zero_device``.
        tare : Tare
            The new tare.
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
            self._take_next(3, timeout)  # frames that arrive now may have been sampled before the command
            return zeroed, self.tare(frames, limit, timeout)
        except BaseException:
            self._zero_state = ZeroState.DEVICE_NOT_CHECKED
            raise

    def give_up(self, why: str) -> None:
        """Refuse a waiting tare immediately, because no frames arrive.

        Any other tare is also refused until `expect` is called.
        """
        with self._changed:
            self._ended = why
            self._changed.notify()

    def expect(self) -> None:
        """Accept tares again, because frames are arriving again."""
        self._ended = ''

    def _measure_next(self, frames: int, limit: float, timeout: float) -> Tare:
        """Return the result of `tare` without changing anything."""
        taken = self._take_next(frames, timeout)
        return measure(taken, limit, self._guard, 0.0 if self.offset is None else self.offset)

    def _take_next(self, frames: int, timeout: float) -> np.ndarray:
        """Return the values of the next complete ``frames``, (frames, rows, cols), or raise TareRefusedError."""
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
                                   remedy='Look up the losses in /diagnostics.')
        return np.stack(taken)
