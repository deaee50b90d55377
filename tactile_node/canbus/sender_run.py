"""Where one sender (a CANopen node of a pad) stands in its sweep; the rules are told in ``assembler``."""

import numpy as np

from tactile_node.canbus.losses import LossReason


class SenderRun:
    """The ascending run of one sender's ranks. ``own``: its ranks, ascending; ``fresh``: flags of all ranks, shared."""

    def __init__(self, own: list[int], fresh: np.ndarray):
        self._own, self._fresh = np.array(own), fresh
        self._ranks_seen = np.zeros(len(fresh), bool)
        self.used = 0  #: TPDOs given as valid
        self._seen = True
        self.forget()

    def forget(self) -> None:
        """As after a whole period: nothing of an earlier one is to come."""
        self._last, self._last_data = int(self._own[-1]), b''
        self.begin_period()
        self._seen = True

    def begin_period(self) -> None:
        self._fresh[self._own] = self._ranks_seen[:] = False
        self._length = 0  # TPDOs in the run under way
        self._previous_end = self._last if self._seen else -1  # last rank of the period before
        self._seen = self._suspect = False

    @property
    def is_complete(self) -> bool:
        return self._length == len(self._own) and not self._suspect

    @property
    def pending(self) -> int:
        """TPDOs that the frame would be made of."""
        return int(self._fresh[self._own].sum())

    def came_late(self, rank: int) -> None:
        """A TPDO of an earlier period: its sender had not ended that one."""
        self._previous_end = rank

    def repeats(self, rank: int, data: bytes) -> bool:
        """Whether this is the TPDO just seen, byte for byte."""
        return self._seen and rank == self._last and data == self._last_data

    def begins_anew(self, rank: int) -> bool:
        """Whether ``rank`` begins another sweep though nothing says that the one before was an old one."""
        return self._seen and rank <= self._last and not self._suspect

    def place(self, rank: int) -> tuple[LossReason, int] | None:
        """Lengthen the run by ``rank``, or begin a new one: then why, and how many TPDOs, the old one is dropped."""
        dropped = None
        if not self._seen:
            self._suspect = rank > self._previous_end
        elif rank <= self._last:
            was_late = self._suspect or self._ranks_seen[rank]
            dropped = LossReason.LATE if was_late else LossReason.OUT_OF_ORDER, self.drop()
        self._length += 1
        self._ranks_seen[rank] = True
        return dropped

    def note(self, rank: int, data: bytes) -> None:
        """This TPDO was seen, whatever became of it."""
        self._last, self._last_data, self._seen = rank, bytes(data), True

    def end(self) -> int:
        """The period ends: drop a run that nothing has proved fresh; how many TPDOs that loses."""
        return self.drop() if self._suspect else 0

    def drop(self) -> int:
        dropped = self.pending
        self._fresh[self._own] = self._ranks_seen[:] = False
        self._length, self._suspect = 0, False
        return dropped
