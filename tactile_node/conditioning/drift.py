"""Follows the slow drift of taxels' zero while nothing presses, and leaves it alone while something does."""

import numpy as np

from tactile_node.taxel_frame import read_only

TIME_CONSTANT = 20.0  #: s in which the zero follows a small step
DRIFT_RATE = 1 / 300        #: ``limit`` a second: faster is no drift
PRESSED_SHARE = 0.5         #: ``limit`` above its zero: a taxel that may be under a contact
QUIET_TIME = 2.0           #: s without such a taxel before the zero is followed (again)


class DriftFollower:
    """The zero of one pad, followed frame by frame; ``limit``: of `tare`, in the taxels' unit.

    While any taxel reads PRESSED_SHARE x limit above its zero, and QUIET_TIME after, the whole pad's zero stands
    still: a grasp, also one that is there from the start, is never taken for drift, and neither are the taxels around
    it. The same while a taxel that has had a value has none. The price: drift beyond PRESSED_SHARE x limit within one
    grasp needs a tare. A touch lighter than that is taken for drift, at no more than DRIFT_RATE x limit a second.
    """

    def __init__(self, limit: float):
        self.limit = limit
        self._stamp = self._pressed_at = -np.inf
        self._seen: np.ndarray | bool = False  # taxels that have had a value

    def update(self, stamp: float, values: np.ndarray, zero: np.ndarray,
               is_faulty: np.ndarray | bool = False, is_contact: bool = False) -> np.ndarray:
        """Return the zero, (rows, cols), after a frame of ``values`` (NaN: unknown) as measured at ``stamp`` [s].

        Taxels that are faulty (bool, (rows, cols)) are not waited for. ``is_contact``: something presses the pad,
        whatever its taxels read above zero.
        """
        passed, self._stamp = stamp - self._stamp, stamp
        above = np.where(np.isfinite(values), values - zero, 0)
        lost = self._seen & ~np.isfinite(values) & ~np.asarray(is_faulty)  # it may be pressed
        self._seen = self._seen | np.isfinite(values)
        if is_contact or lost.any() or (above >= PRESSED_SHARE * self.limit).any() or not 0 <= passed < QUIET_TIME:
            self._pressed_at = stamp
        if stamp - self._pressed_at < QUIET_TIME:
            return zero
        most = DRIFT_RATE * self.limit * passed
        return read_only(zero + np.clip(above * (passed / TIME_CONSTANT), -most, most))
