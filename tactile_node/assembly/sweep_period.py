"""The TPDOs of one pad received between two SYNCs. The module ``assembler`` states the rules."""

import numpy as np

from tactile_node.assembly.sender_run import Payload, SenderRun
from tactile_node.cia301.objects import MAX_PDO_BYTES


class SweepPeriod:
    """One period of a pad.

    Parameters
    ----------
    sequence : int
        Sequence number of the period.
    stamp : float
        Stamp of the period's SYNC [s].
    ranks_of_senders : list of np.ndarray
        Ranks of each sender of the pad, ascending.
    before : SweepPeriod or None
        Previous period; None if none of its TPDOs can arrive any more.
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
        self.is_stamp_wrong = False  #: True if the stamp may be wrong, so that the taxels are not emitted
        self.is_discarded = False  #: True if a SYNC was lost in this period, so that its TPDOs are not used

    @property
    def is_complete(self) -> bool:
        """True if all TPDOs were received and the frame has not been emitted yet.

        A discarded period is never complete.
        """
        return not self.is_emitted and not self.is_discarded and all(run.is_complete for run in self.runs)

    @property
    def pending(self) -> int:
        """Number of TPDOs that may still be used or lost."""
        return 0 if self.is_emitted else sum(run.pending for run in self.runs)

    @property
    def may_be_continued(self) -> bool:
        """True if missing TPDOs of this period may arrive in the next period."""
        return not self.is_emitted and not self.is_discarded and any(run.may_be_continued for run in self.runs)

    def may_continue(self, before: 'SweepPeriod') -> bool:
        """Return True if missing TPDOs of the period ``before`` may still arrive in this period."""
        return not self.is_discarded and not before.is_discarded and any(
            run.is_undecided and earlier.may_be_continued for run, earlier in zip(self.runs, before.runs))

    def return_aside(self, before: 'SweepPeriod', only_proved: bool = False) -> None:
        """Move the runs that were set aside back to the previous period.

        Parameters
        ----------
        before : SweepPeriod
            Period before.
        only_proved : bool
            True to move only the runs with ``SenderRun.is_aside_proved``.
        """
        for run in self.runs:
            if run.is_aside_proved or not only_proved:
                run.return_aside(before.payload)
