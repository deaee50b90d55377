"""What was received of one pad between two SYNCs. ``assembler`` states the rules."""

import numpy as np

from tactile_node.assembly.sender_run import Payload, SenderRun
from tactile_node.cia301.objects import MAX_PDO_BYTES


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
        self.is_stamp_wrong = False  #: or may be, so nothing of it is given
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
