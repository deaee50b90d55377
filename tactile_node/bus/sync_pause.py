"""Decides which SYNCs the producer leaves out, so that the bus is free and shows how far its nodes are."""

from math import ceil

from tactile_node.assembly.free_bus import FREE_TIME

SPACING = 4     #: SYNCs that are sent between two pauses
BACKLOG = 2     #: periods that a node may take to send the sweeps that wait
READING = 2e-3  #: s by which the driver sees a free bus too short


class SyncPause:
    """``period``: of SYNC [s].

    >>> pause = SyncPause(period=0.02)
    >>> [pause.is_due(doubt) for doubt in (False, True, True, True, True, False, False, True)]
    [False, True, True, True, False, False, False, False]
    """

    def __init__(self, period: float):
        self._length = BACKLOG + ceil((FREE_TIME + READING) / period)  # SYNCs
        self.count = 0  #: SYNCs left out
        self.restart()

    def restart(self) -> None:
        """SYNC was off."""
        self._since = SPACING  # SYNCs sent since the last pause
        self._left = 0  # SYNCs to be left out

    def is_due(self, is_in_doubt: bool) -> bool:
        """Whether to leave out the SYNC that is due, where it is in doubt how far a node is."""
        if not is_in_doubt:
            self._left = 0
        elif not self._left and self._since >= SPACING:
            self._left = self._length
            self._since = 0
        if self._left:
            self._left -= 1
            self.count += 1
            return True
        self._since += 1
        return False
