"""Decides which SYNCs the producer leaves out, so that the bus is idle and shows how far its nodes are."""

from math import ceil

SPACING = 4    #: SYNCs that are sent between two pauses
READING = 1e-3  #: s by which the driver sees an idle bus too short
MOST = 10      #: SYNCs left out in a row


class SyncPause:
    """``period``: of SYNC [s].

    >>> pause = SyncPause(period=0.02)
    >>> [pause.is_due(wanted) for wanted in (0.0, 0.03, 0.03, 0.03, 0.0, 0.0, 0.03)]
    [False, True, True, False, False, False, False]
    """

    def __init__(self, period: float):
        self._period = period
        self.count = 0  #: SYNCs left out
        self.restart()

    def restart(self) -> None:
        """SYNC was off."""
        self._since = SPACING  # SYNCs sent since the last pause
        self._left = 0  # SYNCs to be left out

    def is_due(self, idle: float) -> bool:
        """Whether to leave out the SYNC that is due, so that the bus is ``idle`` [s]; 0: it need not be."""
        if not idle:
            self._left = 0
        elif not self._left and self._since >= SPACING:
            self._left = ceil(min((idle + READING) / self._period, MOST))
            self._since = 0
        if self._left:
            self._left -= 1
            self.count += 1
            return True
        self._since += 1
        return False
