"""What has come of one pad between two SYNCs; the rules are told in ``assembler``."""

import numpy as np

from tactile_node.assembly.sender_run import Payload, SenderRun
from tactile_node.cia301.pdo import MAX_PDO_BYTES


class SweepPeriod:
    """One period of a pad whose senders have the ranks ``owns``; ``before`` is the period before, if it counts."""

    def __init__(self, sequence: int, stamp: float, owns: list[np.ndarray], before: 'SweepPeriod | None'):
        self.sequence, self.stamp = sequence, stamp
        size = sum(map(len, owns))
        self.payload = Payload(bytearray(MAX_PDO_BYTES * size), np.zeros(size, bool))
        runs_before = [None] * len(owns) if before is None else before.runs
        self.runs = [SenderRun(own, self.payload, run) for own, run in zip(owns, runs_before)]
        self.is_given = self.is_torn = False

    @property
    def is_complete(self) -> bool:
        return not self.is_given and not self.is_torn and all(run.is_complete for run in self.runs)

    @property
    def pending(self) -> int:
        """TPDOs taken of which it is not yet known what becomes of them."""
        return 0 if self.is_given else sum(run.pending for run in self.runs)

    @property
    def may_be_continued(self) -> bool:
        """Whether the next period may bring what this one lacks."""
        return not self.is_given and not self.is_torn and any(run.may_be_continued for run in self.runs)

    def tells_of(self, before: 'SweepPeriod') -> bool:
        """Whether this period may still bring what ``before`` lacks."""
        return not self.is_torn and not before.is_torn and any(
            run.is_undecided and earlier.may_be_continued for run, earlier in zip(self.runs, before.runs))

    def distrust(self) -> None:
        for run in self.runs:
            run.distrust()

    def hand_back(self, before: 'SweepPeriod') -> None:
        for run in self.runs:
            run.hand_back(before.payload)
