"""How a bus that is free of SYNC shows how far a node is: when it was free, and which SYNCs are left out for that."""

from math import ceil, inf

from tactile_node.cia301.frame_bits import Frame, worst_case_bits

#: s that the bus was free for: more than adapters hold frames back (2 ms), or a busy device pauses between two TPDOs
FREE_TIME = 0.006
SLOW_BITRATE = 125_000  #: bit/s, of a log, which does not say how long its frames have kept the bus busy
PAUSE_SPACING = 4  #: SYNCs that are sent between two pauses


class FreeBus:
    """For how long the bus was free, by stamps [s], when the answer to a SYNC was due and no TPDO came any more.

    A node answers a SYNC within half a period while the bus is free. One that then sends nothing has nothing to send.
    Frames that are no TPDOs may go first, and take their time at ``bitrate`` [bit/s]. A period without any TPDO proves
    nothing: an adapter may hold them back.

    >>> bus = FreeBus(1_000_000)
    >>> bus.sync(0.00); bus.sync(0.02); bus.take(0.021); bus.sync(0.04)
    >>> bus.proves(until=0.032), bus.proves(until=0.041)
    (False, True)
    """

    def __init__(self, bitrate: int):
        self._frame_time = worst_case_bits(Frame(0, bytes(8), is_extended=True)) / bitrate
        self.restart()

    def restart(self) -> None:
        """SYNC was off."""
        self._synced = inf
        self._due = self._due_before = inf  # the answer to the last SYNC, and to the one before
        self._since = self._since_before = inf  # the bus is free, and they did not come

    def sync(self, stamp: float, late: float = 0.0) -> None:
        """A SYNC, which may follow its stamp by ``late`` [s]."""
        self._due_before, self._since_before = self._due, self._since
        self._due = inf if self._synced == inf else stamp + late + (stamp + late - self._synced) / 2
        self._since = inf
        self._synced = stamp

    def take(self, stamp: float) -> None:
        """A TPDO was received, and another may follow."""
        self._since_before = max(self._due_before, stamp)
        self._since = max(self._due, stamp)

    def occupy(self, stamp: float, seconds: float | None = None) -> None:
        """Until this stamp the bus may have carried something else for so long, or a frame that is no TPDO."""
        seconds = self._frame_time if seconds is None else seconds
        if stamp > self._since_before:
            self._since_before += seconds
        if stamp > self._since:
            self._since += seconds

    def proves(self, until: float) -> bool:
        """Whether no answer to the SYNC before the last one is to come, if no TPDO came until this stamp."""
        return until - self._since_before >= FREE_TIME + self._frame_time  # which may be under way


class SyncPause:
    """``period``: of SYNC [s].

    >>> pause = SyncPause(period=0.02)
    >>> [pause.is_due(doubt) for doubt in (False, True, True, True, True, False, False, True)]
    [False, True, True, True, False, False, False, False]
    """

    def __init__(self, period: float):
        # SYNCs: two periods for the sweeps that wait; and the driver sees a free bus 2 ms too short
        self._length = 2 + ceil((FREE_TIME + 2e-3) / period)
        self.count = 0  #: SYNCs left out
        self.restart()

    def restart(self) -> None:
        """SYNC was off."""
        self._since = PAUSE_SPACING  # SYNCs sent since the last pause
        self._left = 0  # SYNCs to be left out

    def is_due(self, is_in_doubt: bool) -> bool:
        """Whether to leave out the SYNC that is due, where it is in doubt how far a node is."""
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
