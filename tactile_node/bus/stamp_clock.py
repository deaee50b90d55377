"""One time line for stamps: Unix time that never goes back, whatever is done to the wall clock."""

import threading
import time
from collections.abc import Callable

CLOCK_JUMP = 0.1  # s between two looks: less may be slewing
CLOCK_DRIFT = 1e-4  # relative: no adapter's crystal is further off


class StampClock:
    """Stamps for what is sent (``now``) and received (``of``), in one epoch and never going back.

    The wall clock set forward is followed. Set back, it is not: stamps continue evenly, ``ahead`` [s] of the wall
    clock, until it has caught up or ``restart``. Each such setting counts in ``jumps``.

    ``host_stamped``: messages carry this machine's wall clock (socketcan, virtual; slcan, when they are read). Else
    they carry the adapter's own clock, of unknown epoch: the least time from stamp to arrival seen so far, let grow by
    ``CLOCK_DRIFT``, is taken for its offset, so a stamp is late by the quickest way through it.
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
        """Take the wall clock as it is now; only where stamps may go back."""
        with self._lock:
            self.ahead = 0.0
            wall, steady = self._both()
            self._offset = wall - steady
            self._before = 0.0  # the offset before the last jump
            self._lead_before = 0.0  # lead of the stamps before the last jump on the steady clock
            self._jumped = -float('inf')  # when
            self._least: float | None = None
            self._looked = steady
            self._last = -float('inf')

    def now(self) -> float:
        """The present [s]; never less than the time before."""
        with self._lock:
            wall, _ = self._look()
            self._last = max(self._last, wall + self.ahead)
            return self._last

    def of(self, timestamp: float) -> float:
        """When the message stamped ``timestamp`` by the bus was received [s]; call it on arrival."""
        with self._lock:
            wall, steady = self._look()
            if not self._host_stamped:
                return wall + self.ahead - self._adapter_age(timestamp, steady)
            if steady - self._jumped > 2.0:  # until then messages stamped before the jump may come
                return timestamp + self.ahead
            ages = [wall - timestamp, steady + self._before - timestamp]  # stamped after, or before the jump
            return wall + self.ahead - min((age for age in ages if age >= 0), default=0.0)

    def age(self, stamp: float) -> float:
        """Return for how long ``stamp`` has been past [s], by the steady clock: also when the wall clock was set since.

        ``stamp`` is one that ``now`` or ``of`` has given, before at most one jump.
        """
        with self._lock:
            _, steady = self._look()
            taken = stamp - self._lead_before
            if taken > self._jumped:
                taken = stamp - self._offset - self.ahead
            return max(0.0, steady - taken)

    def _both(self) -> tuple[float, float]:
        """Both clocks at one time."""
        steady = self._steady()
        for _ in range(10):  # then the last reading is used
            before, wall, steady = steady, self._wall(), self._steady()
            if steady - before < 0.01:  # not held up meanwhile
                break
        return wall, steady

    def _look(self) -> tuple[float, float]:
        wall, steady = self._wall(), self._steady()
        if abs(wall - steady - self._offset) > CLOCK_JUMP:  # or this thread was held up between the two
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
        if self._least is None or lag < self._least or lag - self._least > 1.0:  # begun to count again
            self._least = lag
        else:
            self._least += CLOCK_DRIFT * (steady - self._looked)
        self._looked = steady
        return max(0.0, lag - self._least)
