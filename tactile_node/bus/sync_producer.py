"""Skip SYNCs while a node may be behind, so that the bus stays free for long enough to prove that none is."""

from math import ceil

from tactile_node.assembly.free_bus import FREE_TIME

PAUSE_SPACING = 4  #: Number of SYNCs sent between two pauses.


class SyncPause:
    """Decides which SYNCs to skip while a node may be behind.

    Parameters
    ----------
    period : float
        Time between two SYNCs [s].

    Attributes
    ----------
    count : int
        Number of SYNCs skipped.

    Examples
    --------
    >>> pause = SyncPause(period=0.02)
    >>> [pause.is_due(doubt) for doubt in (False, True, True, True, True, False, False, True)]
    [False, True, True, True, False, False, False, False]
    """

    def __init__(self, period: float):
        # A pause lasts two periods for the waiting sweeps, plus the free time. The driver's measurement of the free
        # time may be up to 2 ms too short.
        self._length = 2 + ceil((FREE_TIME + 2e-3) / period)
        self.count = 0
        self.restart()

    def restart(self) -> None:
        """Forget the last pause, because SYNC was switched off."""
        self._since = PAUSE_SPACING  # SYNCs sent since the last pause
        self._left = 0  # SYNCs still to skip

    def is_due(self, is_in_doubt: bool) -> bool:
        """Return True if the SYNC that is now due must be skipped.

        Parameters
        ----------
        is_in_doubt : bool
            True while the driver does not know which SYNC a node is answering.
        """
        if not is_in_doubt:
            self._left = 0
        elif not self._left and self._since >= PAUSE_SPACING:
            self._left = self._length
            self._since = 0
        if self._left:
            self._left -= 1
            self.count += 1
            return True
        self._since += 1
        return False
