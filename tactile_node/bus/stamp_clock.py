"""A clock for stamps: Unix time that never goes back, even if the wall clock is set back."""

import threading
import time
from collections.abc import Callable

#: Smallest change of wall clock minus steady clock that counts as a jump [s]. A smaller change may be slewing.
CLOCK_JUMP = 0.1
CLOCK_DRIFT = 1e-4  #: Largest relative error of an adapter's crystal.


class StampClock:
    """Provides stamps for sent messages (``now``) and received messages (``of``) in one epoch. They never go back.

    If the wall clock is set forward, the stamps follow it. If it is set back, the stamps continue evenly and lead the
    wall clock by ``ahead`` [s], until the wall clock has caught up or ``restart`` is called. Both kinds of jump count
    in ``jumps``.

    Parameters
    ----------
    host_stamped : bool
        True if messages carry the wall clock of this host: socketcan and virtual stamp on arrival, slcan stamps when
        the message is read. False if messages carry the clock of the adapter, whose epoch is not known.
    wall : callable or None
        Wall clock [s]; None for ``time.time``.
    steady : callable
        Steady clock [s].

    Attributes
    ----------
    ahead : float
        Time by which the stamps lead the wall clock [s].
    jumps : int
        Number of times that the wall clock was set.

    Notes
    -----
    The offset of an adapter's clock is the smallest time from stamp to arrival so far. It grows by CLOCK_DRIFT, so that
    it follows the drift of the clock. The stamps of received messages are therefore late by the shortest time that a
    message takes through the adapter.
    """

    def __init__(self, host_stamped: bool = True, wall: Callable[[], float] | None = None,
                 steady: Callable[[], float] = time.monotonic):
        self._host_stamped = host_stamped
        self._wall = wall or (lambda: time.time())
        self._steady = steady
        self._lock = threading.Lock()
        self.jumps = 0
        self.restart()

    def restart(self) -> None:
        """Follow the wall clock as it is now. The stamps may go back, so the caller must allow for that."""
        with self._lock:
            self.ahead = 0.0
            wall, steady = self._both()
            self._offset = wall - steady
            self._before = 0.0  # offset before the last jump
            self._lead_before = 0.0  # stamp minus steady clock before the last jump
            self._jumped = -float('inf')  # time of the last jump on the steady clock
            self._least: float | None = None
            self._looked = steady
            self._last = -float('inf')

    def now(self) -> float:
        """Return the present time [s]. It is never below an earlier result."""
        with self._lock:
            wall, _ = self._look()
            self._last = max(self._last, wall + self.ahead)
            return self._last

    def of(self, timestamp: float) -> float:
        """Return the time at which a message was received [s].

        Parameters
        ----------
        timestamp : float
            Stamp of the message by the host or the adapter [s]. The method must be called when the message arrives.
        """
        with self._lock:
            wall, steady = self._look()
            if not self._host_stamped:
                return wall + self.ahead - self._adapter_age(timestamp, steady)
            if steady - self._jumped > 2.0:  # messages stamped before the jump have all arrived
                return timestamp + self.ahead
            ages = [wall - timestamp, steady + self._before - timestamp]  # stamped after or before the jump
            return wall + self.ahead - min((age for age in ages if age >= 0), default=0.0)

    def age(self, stamp: float) -> float:
        """Return the age of a stamp [s]. It is correct even if the wall clock was set once since the stamp.

        Parameters
        ----------
        stamp : float
            Result of ``now`` or ``of`` [s].
        """
        with self._lock:
            _, steady = self._look()
            taken = stamp - self._lead_before
            if taken > self._jumped:
                taken = stamp - self._offset - self.ahead
            return max(0.0, steady - taken)

    def _both(self) -> tuple[float, float]:
        """Return wall clock and steady clock, read at the same time [s]."""
        steady = self._steady()
        for _ in range(10):  # after ten attempts the last reading is used
            before, wall, steady = steady, self._wall(), self._steady()
            if steady - before < 0.01:  # the thread was not held up between the readings
                break
        return wall, steady

    def _look(self) -> tuple[float, float]:
        wall, steady = self._wall(), self._steady()
        if abs(wall - steady - self._offset) > CLOCK_JUMP:  # a jump, or the thread was held up here
            wall, steady = self._both()
        offset = wall - steady
        if abs(step := offset - self._offset) > CLOCK_JUMP:
            self.jumps += 1
            self._before, self._jumped = self._offset, steady
            self._lead_before = self._offset + self.ahead
            self.ahead = max(0.0, self.ahead - step)
        self._offset = offset
        return wall, steady

    def _adapter_age(self, timestamp: float, steady: float) -> float:
        lag = steady - timestamp
        if self._least is None or lag < self._least or lag - self._least > 1.0:  # the clock has restarted
            self._least = lag
        else:
            self._least += CLOCK_DRIFT * (steady - self._looked)
        self._looked = steady
        return max(0.0, lag - self._least)
