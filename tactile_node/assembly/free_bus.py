"""Use the times at which the bus is free to prove that no node is behind."""

from math import inf
from typing import NamedTuple

from tactile_node.cia301.frame_bits import CanFrame, worst_case_bits

#: Time for which the bus must be free [s]. Adapters hold frames back for at most 2 ms, and a busy device pauses for
#: less than this time between two TPDOs.
FREE_TIME = 0.006
#: Bit rate assumed for a log [bit/s]. A log does not record how long its frames occupied the bus.
SLOW_BITRATE = 125_000


class BatchArrival(NamedTuple):
    """The time in which the messages of a batch arrived."""

    #: stamps between which all messages arrived [s]; None if the stamp of each message is its time of arrival
    interval: tuple[float, float] | None
    most_free: float  #: longest time for which the bus may have been free before the batch, on the steady clock [s]


class FreeBus:
    """Measures how long the bus stayed free after the answers to a SYNC were due. All times are stamps [s].

    While the bus is free, a node answers a SYNC within half a period. A node that sends nothing within half a period
    therefore has nothing left to send. Other frames may occupy the bus first. The time that these frames take at the
    bit rate does not count as free. A period without any TPDO proves nothing, because an adapter may be holding the
    TPDOs back.

    Parameters
    ----------
    bitrate : int
        Bit rate [bit/s].

    Examples
    --------
    >>> bus = FreeBus(1_000_000)
    >>> bus.sync(0.00); bus.sync(0.02); bus.saw_tpdo(0.021); bus.sync(0.04)
    >>> bus.nothing_pending(until=0.032), bus.nothing_pending(until=0.041)
    (False, True)
    """

    def __init__(self, bitrate: int):
        self._frame_time = worst_case_bits(CanFrame(0, bytes(8), is_extended=True)) / bitrate
        self._free_time = FREE_TIME + self._frame_time  # a frame may be on the bus when the time is measured
        self._arrived = -inf  # stamp before which all frames so far had arrived
        self.restart()

    def restart(self) -> None:
        """Forget all SYNCs, because SYNC was switched off."""
        self._synced = inf
        self._due = self._due_before = inf  # latest time of an answer to the last SYNC, and to the SYNC before it
        self._since = self._since_before = inf  # time since which the bus has been free while that answer is missing

    def sync(self, stamp: float, late: float = 0.0) -> None:
        """Note a SYNC.

        Parameters
        ----------
        stamp : float
            Stamp of the SYNC [s].
        late : float
            Largest delay of the SYNC after its stamp [s].
        """
        self._due_before, self._since_before = self._due, self._since
        self._due = inf if self._synced == inf else stamp + late + (stamp + late - self._synced) / 2
        self._since = inf
        self._synced = stamp

    def saw_tpdo(self, stamp: float) -> None:
        """Record that a TPDO was received at ``stamp`` [s]. Another TPDO may follow."""
        self._since_before = stamp if stamp > self._due_before else self._due_before
        self._since = stamp if stamp > self._due else self._due

    def saw_frame(self, stamp: float) -> None:
        """Record that a frame that does not answer SYNC was received at ``stamp`` [s]."""
        self._occupy(stamp, self._frame_time)

    def saw_error(self, stamp: float) -> None:
        """Record an error frame. The bus may have more errors, so no time before ``stamp`` [s] counts as free."""
        self._occupy(stamp, inf)

    def arrived(self, after: float, until: float, most_free: float) -> None:
        """Record that a frame arrived, and that the bus may have been busy before.

        If the stamps advance by more than ``most_free``, unknown frames may have occupied the bus for the rest of the
        time, or the wall clock was set.

        Parameters
        ----------
        after : float
            Stamp after which the frame arrived [s].
        until : float
            Stamp before which the frame arrived [s].
        most_free : float
            Longest time for which the bus may have been free since the previous frame [s].
        """
        self._occupy(after, max(0.0, after - self._arrived - most_free))
        self._arrived = until

    def nothing_pending(self, until: float) -> bool:
        """Return True if no node can still answer the second-to-last SYNC.

        Parameters
        ----------
        until : float
            Stamp up to which no further TPDO was received [s].
        """
        return until - self._since_before >= self._free_time

    def _occupy(self, until: float, seconds: float) -> None:
        """Exclude ``seconds`` [s] before the stamp ``until`` [s] from the time for which the bus was free."""
        if until > self._since_before:
            self._since_before += seconds
        if until > self._since:
            self._since += seconds
