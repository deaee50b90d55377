"""Where one sender (a CANopen node of a pad) stands in one period's sweep; the rules are told in ``assembler``."""

from typing import NamedTuple

import numpy as np

from tactile_node.cia301.pdo import MAX_PDO_BYTES
from tactile_node.frames.losses import Loss, LossReason

CATCHING_UP = 3  #: periods: a sender that has not caught up by then has lost sweeps, rather than being behind


class Payload(NamedTuple):
    """The TPDOs of one period, by rank."""

    words: bytearray  #: MAX_PDO_BYTES bytes each
    fresh: np.ndarray  #: bool, which of them belong to the period


class SenderRun:
    """The ascending run of one sender's ranks in one period.

    ``own``: its ranks, ascending. ``before``: its run of the period before; None where nothing of an earlier period
    is to come.

    While the sender may be ``_behind``, by so many runs of earlier periods, its run is suspect: it may be one of
    these. Where it is only one, that one has none but ranks above ``_owed``; and where it can be of no other than the
    period before, ``_is_of_before``.
    """

    def __init__(self, own: np.ndarray, payload: Payload, before: 'SenderRun | None'):
        self._own, self._payload, self._top = own, payload, int(own[-1])
        self._ranks: set[int] = set()  # of the run under way
        self._last, self._last_data = -1, b''
        self.is_seen = self._is_suspect = self._was_unproved = self._is_starting = False
        self._aside: dict[int, bytes] = {}  # a suspect run, when the sender has begun anew
        self._periods_unproved = 0
        self._owe(0)
        if before is not None:
            self.follow(before)

    def follow(self, before: 'SenderRun') -> None:
        """Count the runs that may still come before this period's own.

        A period that ended early, or was silent, adds one. All are forgotten after CATCHING_UP unproved periods: a
        sweep may be lost for good.
        """
        is_behind = before._behind > 0 and (before._was_unproved or not before.is_seen)
        unproved = before._periods_unproved + before._was_unproved
        if unproved == CATCHING_UP:
            is_behind = False
        self._periods_unproved = unproved if is_behind else 0
        carried = before._behind if is_behind else 0
        if before.is_seen:
            self._owe(carried + (before._last < self._top), -1 if carried else before._last,
                      not before._was_unproved)
        elif before._is_starting:
            self._owe(0)
        else:
            self._owe(carried + 1, -1, before._behind == 0)

    @property
    def is_complete(self) -> bool:
        return len(self._ranks) == len(self._own) and not self._is_suspect

    @property
    def is_doubtful(self) -> bool:
        """After its period: whether it is unknown which sweep the sender was at."""
        return self._was_unproved if self.is_seen else self._behind > 0

    @property
    def may_be_continued(self) -> bool:
        """Whether the next period may bring, beyond doubt, what this one lacks."""
        return not self.is_doubtful and self._last < self._top

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
            self._owe(0)

    def distrust(self) -> None:
        """It is not known what the sender has done so far."""
        self._owe(1)

    def came_late(self, rank: int) -> None:
        """A TPDO of an earlier period was seen, too late for anything but to tell where its sender stands."""
        if self.is_seen:
            if rank <= self._last:
                self._owe(max(self._behind - 1, 0))
            self._last = rank
        elif self._behind == 0:
            self._owe(int(rank < self._top), rank)
        elif rank == self._top:
            self._owe(self._behind - 1)

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
            if self._behind == 1 and rank <= self._owed:  # not what was owed, which is then lost
                self._owe(0)
            self._is_suspect = self._behind > 0
        elif rank <= self._last:
            lost = self._begin_next(rank)
        self._ranks.add(rank)
        return lost

    def note(self, rank: int, data: bytes) -> None:
        """This TPDO was seen, whatever became of it."""
        self._last, self._last_data, self.is_seen = rank, bytes(data), True

    def end(self) -> int:
        """The period ends: drop what nothing has proved to be of any period; how many TPDOs that loses."""
        self._was_unproved = self._is_suspect
        return self.drop() if self._is_suspect else self.forget_aside()

    def drop(self) -> int:
        dropped = self.used + self.forget_aside()
        self._begin()
        return dropped

    def hand_back(self, before: Payload) -> None:
        """Give the run that was set aside to the period before."""
        for rank, word in self._aside.items():
            before.words[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * (rank + 1)] = word
            before.fresh[rank] = True
        self._aside.clear()

    def forget_aside(self) -> int:
        """Drop the run that was set aside; how many TPDOs that loses."""
        dropped = len(self._aside)
        self._aside.clear()
        return dropped

    def _owe(self, behind: int, above: int = -1, is_of_before: bool = False) -> None:
        self._behind, self._owed, self._is_of_before = behind, above, is_of_before and behind == 1

    def _begin_next(self, rank: int) -> Loss | None:
        lost = None
        if self._is_suspect and self._is_of_before:
            self._set_aside()
        else:
            was_late = self._is_suspect or bool(self._aside) or rank in self._ranks
            lost = Loss(LossReason.LATE if was_late else LossReason.OUT_OF_ORDER, self.drop())
        self._owe(max(self._behind - 1, 0))
        self._is_suspect = self._behind > 0
        return lost

    def _set_aside(self) -> None:
        words, fresh = self._payload
        self._aside = {rank: bytes(words[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * (rank + 1)])
                       for rank in self._own if fresh[rank]}
        self._begin()

    def _begin(self) -> None:
        self._payload.fresh[self._own] = False
        self._ranks.clear()
        self._is_suspect = False
