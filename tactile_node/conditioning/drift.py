"""Follow the slow drift of the taxels' zero while nothing presses the pad, and hold the zero during a touch."""

import numpy as np

from tactile_node.taxel_frame import read_only

TIME_CONSTANT = 20.0  #: Time constant with which the zero follows a small step [s].
DRIFT_RATE = 1 / 300  #: Largest drift per second, as a share of ``limit``. A faster change does not count as drift.
PRESSED_SHARE = 0.5   #: A taxel that reads at least this share of ``limit`` above its zero may be part of a contact.

#: Time for which no taxel may be part of a contact before the zero follows the readings again [s].
QUIET_TIME = 2.0


class DriftFollower:
    """The zero of one pad, updated frame by frame.

    The zero of the whole pad is held while any taxel reads PRESSED_SHARE x limit above its zero, and for QUIET_TIME
    afterwards. A grasp is therefore never mistaken for drift, even if it is present from the first frame. The readings
    of the taxels around a grasp are not mistaken for drift, either. If a taxel that previously had a value has none,
    the zero is also held.

    This method has two drawbacks. If the readings drift by more than PRESSED_SHARE x limit during one
    grasp, a tare is needed. A lighter touch is mistaken for drift, but changes the zero by no more than DRIFT_RATE x
    limit per second.

    Parameters
    ----------
    limit : float
        Tare limit, in the taxels' unit.
    """

    def __init__(self, limit: float):
        self.limit = limit
        self._stamp = self._pressed_at = -np.inf
        self._seen: np.ndarray | bool = False  # taxels that have had a value

    def update(self, stamp: float, values: np.ndarray, zero: np.ndarray,
               is_faulty: np.ndarray | bool = False, is_contact: bool = False) -> np.ndarray:
        """Return the zero after one more frame, (rows, cols).

        Parameters
        ----------
        stamp : float
            Time at which the frame was acquired [s].
        values : np.ndarray
            Taxel values as measured, (rows, cols); NaN if unknown.
        zero : np.ndarray
            Zero before this frame, (rows, cols).
        is_faulty : np.ndarray or bool
            True for faulty taxels, bool (rows, cols). Missing values of faulty taxels do not hold the zero.
        is_contact : bool
            True if something presses the pad, even if no taxel reads much above its zero.
        """
        passed, self._stamp = stamp - self._stamp, stamp
        above = np.where(np.isfinite(values), values - zero, 0)
        lost = self._seen & ~np.isfinite(values) & ~np.asarray(is_faulty)  # a taxel without a value may be pressed
        self._seen = self._seen | np.isfinite(values)
        if is_contact or lost.any() or (above >= PRESSED_SHARE * self.limit).any() or not 0 <= passed < QUIET_TIME:
            self._pressed_at = stamp
        if stamp - self._pressed_at < QUIET_TIME:
            return zero
        most = DRIFT_RATE * self.limit * passed
        return read_only(zero + np.clip(above * (passed / TIME_CONSTANT), -most, most))
