"""What was received of one pad between two SYNCs. ``assembler`` states the rules."""

from math import inf

import numpy as np

from tactile_node.assembly.sender_run import Payload, SenderRun
from tactile_node.cia301.frame_bits import Frame, worst_case_bits
from tactile_node.cia301.objects import MAX_PDO_BYTES

#: s that the bus was free for: more than adapters hold frames back (2 ms), or a busy device pauses between two TPDOs
FREE_TIME = 0.006
SLOW_BITRATE = 125_000  #: bit/s, of a log, which does not say how long its frames have kept the bus busy


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

    def sync(self, stamp: float) -> None:
        self._due_before, self._since_before = self._due, self._since
        self._due = inf if self._synced == inf else stamp + (stamp - self._synced) / 2
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


class SweepPeriod:
    """One period of a pad.

    ``ranks_of_senders``: the ranks of each of its senders, ascending. ``before``: the period before; None where
    nothing of it can come any more.
    """

    def __init__(self, sequence: int, stamp: float, ranks_of_senders: list[np.ndarray],
                 before: 'SweepPeriod | None'):
        self.sequence = sequence
        self.stamp = stamp
        size = sum(map(len, ranks_of_senders))
        self.payload = Payload(bytearray(MAX_PDO_BYTES * size), np.zeros(size, bool))
        runs_before = [None] * len(ranks_of_senders) if before is None else before.runs
        self.runs: list[SenderRun] = [SenderRun(own, self.payload, run)
                                      for own, run in zip(ranks_of_senders, runs_before)]
        self.is_emitted = False
        self.is_discarded = False  #: a SYNC was lost in it, so nothing of it is used

    @property
    def is_complete(self) -> bool:
        return not self.is_emitted and not self.is_discarded and all(run.is_complete for run in self.runs)

    @property
    def pending(self) -> int:
        """TPDOs that may still be used or lost."""
        return 0 if self.is_emitted else sum(run.pending for run in self.runs)

    @property
    def may_be_continued(self) -> bool:
        """Whether the next period may bring what this one lacks."""
        return not self.is_emitted and not self.is_discarded and any(run.may_be_continued for run in self.runs)

    def may_continue(self, before: 'SweepPeriod') -> bool:
        """Whether this period may still bring what ``before`` lacks."""
        return not self.is_discarded and not before.is_discarded and any(
            run.is_undecided and earlier.may_be_continued for run, earlier in zip(self.runs, before.runs))

    def return_aside(self, before: 'SweepPeriod', only_proved: bool = False) -> None:
        """Give the runs that were set aside to the period before; ``only_proved``: see ``is_aside_proved``."""
        for run in self.runs:
            if run.is_aside_proved or not only_proved:
                run.return_aside(before.payload)
