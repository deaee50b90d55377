"""Provide stamps in Unix time that never go back, even if the wall clock is set back."""

import threading
import time
from collections.abc import Callable

# The wall clock has jumped if its difference from the steady clock has changed by more than CLOCK_JUMP, plus SLEW_RATE
# times the time since the last reading. A change of more than MOST_SLEWED is always a jump.
CLOCK_JUMP = 0.02  #: Largest error of the difference between two readings [s].
SLEW_RATE = 0.1  #: Largest relative rate at which a daemon slews the clock; chrony slews at up to 0.083.
MOST_SLEWED = 0.1  #: Largest change that may come from slewing while nothing was read [s].
CLOCK_DRIFT = 1e-4  #: Largest relative frequency error of an adapter's crystal.


class StampClock:
    """Provides stamps for sent messages (``now``) and received messages (``of``) in one epoch.

    The stamps never go back.

    If the wall clock is set forward, the stamps follow it. If the wall clock is set back, the stamps continue evenly
    and lead it by ``ahead`` [s], until the wall clock has caught up or ``restart`` is called. ``jumps`` counts the
    jumps in both directions.

    Parameters
    ----------
    host_stamped : bool
        True if messages carry stamps from the wall clock of this host. The socketcan and virtual interfaces stamp on
        arrival, and slcan stamps when the message is read. False if messages carry stamps from the adapter's clock,
        whose epoch is unknown.
    wall : callable or None
        Function that returns the wall clock [s]; None for ``time.time``.
    steady : callable
        Steady clock [s].

    Attributes
    ----------
    ahead : float
        Time by which the stamps lead the wall clock [s].
    jumps : int
        Number of times the wall clock was set.

    Notes
    -----
    The offset of an adapter's clock is the smallest delay from stamp to arrival so far. The offset grows by
    CLOCK_DRIFT, so that it follows the drift of the adapter's clock. The stamps of received messages are therefore late
    by the shortest time that a message spends in the adapter.
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
        """Adopt the present time of the wall clock. The stamps may go back after a restart, so the caller must allow
        for that."""
        with self._lock:
            self.ahead = 0.0
            wall, steady = self._both()
            self._offset = wall - steady
            self._read = steady  # time when the offset was read, on the steady clock
            self._before = 0.0  # offset of the wall clock before the last jump
            self._lead_before = 0.0  # stamp minus steady clock before the last jump
            self._jumped = -float('inf')  # time of the last jump, on the steady clock
            self._jumped_to = float('inf')  # wall clock after the last jump if it jumped forward [s]
            self._least: float | None = None
            self._looked = steady
            self._last = -float('inf')

    def now(self) -> float:
        """Return the present time [s]. The time is never earlier than a previous result."""
        with self._lock:
            wall, _ = self._look()
            self._last = max(self._last, wall + self.ahead)
            return self._last

    def of(self, timestamp: float) -> float:
        """Return the time at which a message was received [s].

        Parameters
        ----------
        timestamp : float
            Stamp of the message by the host or the adapter [s]. The caller must call ``of`` as soon as the message
            arrives.
        """
        with self._lock:
            wall, steady = self._look()
            if not self._host_stamped:
                return wall + self.ahead - self._adapter_age(timestamp, steady)
            # all messages stamped before the jump have arrived by now, or this message was stamped after the jump
            if steady - self._jumped > 2.0 or timestamp >= self._jumped_to:
                return timestamp + self.ahead
            # age of a message stamped after the jump, and of one stamped before the jump
            ages = [wall - timestamp, steady + self._before - timestamp]
            return wall + self.ahead - min((age for age in ages if age >= 0), default=0.0)

    def acquired(self, stamp: float) -> float:
        """Return the time on the steady clock that a stamp denotes [s].

        The time is correct even if the wall clock was set once after the message was stamped.

        Parameters
        ----------
        stamp : float
            A result of ``now`` or ``of`` [s].
        """
        with self._lock:
            _, steady = self._look()
            taken = stamp - self._lead_before
            if taken > self._jumped:
                taken = stamp - self._offset - self.ahead
            return min(steady, taken)

    def _both(self) -> tuple[float, float]:
        """Return the wall clock and the steady clock, read at the same time [s]."""
        steady = self._steady()
        for _ in range(10):  # after ten attempts, the last reading is used
            before, wall, steady = steady, self._wall(), self._steady()
            if steady - before < 0.01:  # the thread was not interrupted between the readings
                break
        return wall, steady

    def _look(self) -> tuple[float, float]:
        wall, steady = self._wall(), self._steady()
        most = min(CLOCK_JUMP + SLEW_RATE * (steady - self._read), MOST_SLEWED)
        if abs(wall - steady - self._offset) > most:  # the clock has jumped, or the thread was interrupted here
            wall, steady = self._both()
        offset = wall - steady
        if abs(step := offset - self._offset) > most:
            self.jumps += 1
            self._before, self._jumped = self._offset, steady
            self._jumped_to = wall if step > 0 else float('inf')
            self._lead_before = self._offset + self.ahead
            self.ahead = max(0.0, self.ahead - step)
        self._offset = offset
        self._read = steady
        return wall, steady

    def _adapter_age(self, timestamp: float, steady: float) -> float:
        lag = steady - timestamp
        # a lag beyond this limit means that the adapter's clock has restarted
        if self._least is None or lag < self._least or lag - self._least > 1.0:
            self._least = lag
        else:
            self._least += CLOCK_DRIFT * (steady - self._looked)
        self._looked = steady
        return max(0.0, lag - self._least)
