"""Where one sender (a CANopen node of a pad) stands in one period's sweep; the rules are told in ``assembler``."""

from typing import NamedTuple

import numpy as np

from tactile_node.canbus.losses import Loss, LossReason

WORD = 8  #: bytes kept for each TPDO
CATCHING_UP = 3  #: periods: a sender that has not caught up by then has lost sweeps, rather than being behind


class Payload(NamedTuple):
    """The TPDOs of one period, by rank."""

    words: bytearray  #: WORD bytes each
    fresh: np.ndarray  #: bool, which of them belong to the period


class SenderRun:
    """The ascending run of one sender's ranks in one period.

    ``own``: its ranks, ascending. ``before``: its run of the period before; None where nothing of an earlier period
    is to come.
    """

    def __init__(self, own: np.ndarray, payload: Payload, before: 'SenderRun | None'):
        self._own, self._payload, self._end = own, payload, int(own[-1])
        self._ranks_seen = np.zeros(len(payload.fresh), bool)
        self._length = 0  # TPDOs in the run under way
        self._last, self._last_data = -1, b''
        self.is_seen = self._is_suspect = self._was_unproved = False
        self._aside: dict[int, bytes] = {}  # a suspect run, when the sender has begun anew
        self._behind, self._periods_behind, self._owed, self._is_owed_known = 0, 0, self._end, True
        self._is_starting = False
        if before is not None:
            self.follow(before)

    def follow(self, before: 'SenderRun') -> None:
        """Count the runs of earlier periods that may still come; the first has ranks above ``_owed``.

        A silent period adds one. They are forgotten after CATCHING_UP periods: a sweep may be lost for good.
        """
        self._periods_behind = before._periods_behind + 1 if before._was_unproved else 0
        if before._is_starting and not before.is_seen:
            self._owed, self._behind = self._end, 0
        elif before.is_seen:
            is_behind = 0 < self._periods_behind < CATCHING_UP
            self._owed = -1 if is_behind else before._last
            self._behind = (before._behind if is_behind else 0) + (before._last < self._end)
        else:
            self._owed, self._behind = -1, before._behind + 1
        self._is_owed_known = self._behind == 1 and not before._was_unproved

    @property
    def is_complete(self) -> bool:
        return self._length == len(self._own) and not self._is_suspect

    @property
    def may_be_continued(self) -> bool:
        """Whether the next period may bring, beyond doubt, what this one lacks."""
        if not self.is_seen:
            return self._behind == 0
        return self._last < self._end and not self._was_unproved

    @property
    def is_undecided(self) -> bool:
        """Whether what has come may be, or what will come may tell, of the period before."""
        return not self.is_seen or self._is_suspect or bool(self._aside)

    @property
    def used(self) -> int:
        """TPDOs that the frame would be made of."""
        return int(self._payload.fresh[self._own].sum())

    @property
    def pending(self) -> int:
        return self.used + len(self._aside)

    def start(self) -> None:
        """The sender, which did not send, was started: it owes nothing for this period or for one before."""
        self._is_starting = True
        if not self.is_seen:
            self._owed, self._behind, self._is_owed_known = self._end, 0, False

    def came_late(self, rank: int) -> None:
        """A TPDO of an earlier period: its sender had not ended that one."""
        self._behind, self._owed, self._is_owed_known = int(rank < self._end), rank, False

    def repeats(self, rank: int, data: bytes) -> bool:
        """Whether this is the TPDO just seen, byte for byte."""
        return self.is_seen and rank == self._last and data == self._last_data

    def begins_anew(self, rank: int) -> bool:
        """Whether ``rank`` begins another sweep though nothing says that the one before was an old one."""
        return self.is_seen and rank <= self._last and not self._is_suspect

    def place(self, rank: int) -> Loss | None:
        """Lengthen the run by ``rank``, or begin a new one: then what of the old one is dropped, and why."""
        lost = None
        if not self.is_seen:
            self._behind -= self._behind == 1 and rank <= self._owed
            self._is_suspect = self._behind > 0
        elif rank <= self._last:
            lost = self._begin_next(rank)
        self._length += 1
        self._ranks_seen[rank] = True
        return lost

    def note(self, rank: int, data: bytes) -> None:
        """This TPDO was seen, whatever became of it."""
        self._last, self._last_data, self.is_seen = rank, bytes(data), True

    def end(self) -> int:
        """The period ends: drop what nothing has proved to be of any period; how many TPDOs that loses."""
        self._was_unproved = self._is_suspect
        return self.drop() if self._is_suspect else self._forget_aside()

    def drop(self) -> int:
        dropped = self.used + self._forget_aside()
        self._begin_anew()
        return dropped

    def hand_back(self, before: Payload) -> None:
        """Give the run that was set aside to the period before."""
        for rank, word in self._aside.items():
            before.words[WORD * rank:WORD * (rank + 1)] = word
            before.fresh[rank] = True
        self._aside.clear()

    def _begin_next(self, rank: int) -> Loss | None:
        if self._is_suspect and self._is_owed_known:
            self._set_aside()
            lost = None
        else:
            was_late = self._is_suspect or bool(self._aside) or self._ranks_seen[rank]
            lost = Loss(LossReason.LATE if was_late else LossReason.OUT_OF_ORDER, self.drop())
        self._behind = max(self._behind - 1, 0)
        self._is_suspect = self._behind > 0
        return lost

    def _set_aside(self) -> None:
        words, fresh = self._payload
        self._aside = {rank: bytes(words[WORD * rank:WORD * (rank + 1)]) for rank in self._own if fresh[rank]}
        self._begin_anew()

    def _forget_aside(self) -> int:
        dropped = len(self._aside)
        self._aside.clear()
        return dropped

    def _begin_anew(self) -> None:
        self._payload.fresh[self._own] = self._ranks_seen[:] = False
        self._length, self._is_suspect = 0, False
