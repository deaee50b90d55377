"""How far one sender (a CANopen node of a pad) is in the sweep of one period. ``assembler`` states the rules.

                  not behind
    EMPTY ----------------------------> CURRENT ---.
      |                                    ^  ^    |  next run: this one is lost
      | may be behind                      |  '----'
      v                                    |
    SUSPECT -------------------------------'
      |   next run: one run less behind; this one goes back to the period before, or is lost (LATE)
      |   (still SUSPECT where the sender was behind by more than one)
      '-- SYNC: lost (LATE), since nothing proves that it is of this period

    After a free bus (settle) SUSPECT becomes CURRENT at SYNC: no run was late, and none followed to show the contrary.

How many runs the sender is behind when a period begins:

    the period before        adds   which may consist of
    ended with its last rank 0      -
    ended early              1      ranks above its end
    was silent               1      any ranks
    its sender was started   none   - (and all runs before it are forgotten)

Runs that the period before was behind are carried over, while it ended SUSPECT or was silent.
"""

from typing import NamedTuple

import numpy as np

from tactile_node.assembly.frame_source import LossReason
from tactile_node.cia301.objects import MAX_PDO_BYTES


class Payload(NamedTuple):
    """The TPDOs of one period, by rank."""

    words: bytearray  #: MAX_PDO_BYTES bytes each
    fresh: np.ndarray  #: bool, which of them belong to the period


Lost = tuple[LossReason, int]  # why, and how many TPDOs


class SenderRun:
    """The ascending run of one sender's ranks in one period.

    ``own``: the sender's ranks, ascending. ``before``: its run of the period before; None where nothing of an
    earlier period can come.
    """

    def __init__(self, own: np.ndarray, payload: Payload, before: 'SenderRun | None'):
        self._own = own
        self._payload = payload
        self._top = int(own[-1])
        self._ranks: set[int] = set()  # received in the run under way
        self.last = -1  #: rank received last
        self._last_data = b''
        self._aside: dict[int, bytes] = {}  # a suspect run, after the sender has begun the next one
        self.is_aside_proved = False  #: the sender has begun its next run: what is aside is of the period before
        self.received: list[int] = []  #: ranks, in the order in which they came; at most one more than a sweep has
        self.is_seen = False  # anything was received
        self._is_suspect = False
        self._ended_suspect = False
        self._is_doubted = False  # a period has passed that could have shown whether the sender is behind
        self._was_started = False
        self.is_settled = False  #: a free bus has proved that the sender is not behind
        self._was_silent = False  # in the period before
        self._expect_late(0)
        if before is not None:
            self.carry_over(before)

    def carry_over(self, before: 'SenderRun') -> None:
        """Count the runs that may still come before this period's own."""
        self._was_silent = not before.is_seen
        is_behind = before._behind > 0 and (before._ended_suspect or not before.is_seen)
        self._is_doubted = is_behind and (before._ended_suspect or before._is_doubted)
        carried = before._behind if is_behind else 0
        if before.is_seen:
            self._expect_late(carried + (before.last < self._top), -1 if carried else before.last,
                              not before._ended_suspect)
        elif before._was_started:
            self._expect_late(0)
        else:
            self._expect_late(carried + 1, -1, before._behind == 0)

    @property
    def is_complete(self) -> bool:
        return len(self._ranks) == len(self._own) and not self._is_suspect

    @property
    def is_position_unknown(self) -> bool:
        """After its period: whether it is unknown in which sweep the sender was."""
        return self._ended_suspect if self.is_seen else self._behind > 0

    @property
    def may_be_continued(self) -> bool:
        """Whether the next period may bring what this one lacks, without doubt to which of both it belongs."""
        return not self.is_position_unknown and self.last < self._top

    @property
    def is_in_doubt(self) -> bool:
        """Whether the sender sends and may still be behind, though a period has passed that could have shown it."""
        return self._is_doubted and not self._was_silent

    @property
    def is_undecided(self) -> bool:
        """Whether TPDOs received so far, or the next ones, may still be of the period before."""
        return not self.is_seen or self._is_suspect or bool(self._aside)

    @property
    def used(self) -> int:
        """Number of TPDOs that a frame would be made of now."""
        return int(self._payload.fresh[self._own].sum())

    @property
    def pending(self) -> int:
        return self.used + len(self._aside)

    def start(self) -> None:
        """The sender, which did not send, was started: it is not behind."""
        self._was_started = True
        if not self.is_seen:
            self._expect_late(0)

    def settle(self) -> None:
        """No run of an earlier period begins any more. The tail of one needs no such proof: it has its own."""
        if not self.is_seen and self._late_above < 0:
            self.is_settled = True
            self._is_doubted = False

    def assume_behind(self) -> None:
        """It is not known what the sender has sent so far, so its first run may be an old one."""
        self._expect_late(1)

    def note_late(self, rank: int) -> None:
        """A TPDO of an earlier period was received, too late to be used; it only shows where its sender is."""
        if self.is_seen:
            if rank <= self.last:
                self._expect_late(max(self._behind - 1, 0))
            self.last = rank
        elif self._behind == 0:
            self._expect_late(int(rank < self._top), rank)
        elif rank == self._top:
            self._expect_late(self._behind - 1)

    def repeats(self, rank: int, data: bytes) -> bool:
        """Whether this is the TPDO received last, byte for byte."""
        return self.is_seen and rank == self.last and data == self._last_data

    def begins_next_sweep(self, rank: int) -> bool:
        """Whether ``rank`` begins another sweep though the run before is not suspect."""
        return self.is_seen and rank <= self.last and not self._is_suspect

    def add(self, rank: int) -> Lost | None:
        """Continue the run with ``rank``, or begin the next one; what that loses of the run before."""
        lost = None
        if not self.is_seen:
            if self._behind == 1 and rank <= self._late_above:  # the delayed tail cannot come any more
                self._expect_late(0)
            self._is_suspect = self._behind > 0
        elif rank <= self.last:
            lost = self._begin_next(rank)
        self._ranks.add(rank)
        return lost

    def note_received(self, rank: int, data: bytes) -> None:
        """This TPDO was received, used or not."""
        self.last = rank
        if len(self.received) <= len(self._own):  # without SYNC a period never ends: the list must not grow with it
            self.received.append(rank)
        self._last_data = bytes(data)
        self.is_seen = True

    def end(self) -> int:
        """End the period and lose what is not proved to be of any period; the number of TPDOs lost."""
        if self.is_settled:
            self._is_suspect = False
        self._ended_suspect = self._is_suspect
        return self.lose() if self._is_suspect else self.lose_aside()

    def lose(self) -> int:
        """Lose all TPDOs of the period so far; their number."""
        lost = self.used + self.lose_aside()
        self._clear()
        return lost

    def lose_aside(self) -> int:
        """Lose the run that was set aside; the number of its TPDOs."""
        lost = len(self._aside)
        self._aside.clear()
        return lost

    def return_aside(self, before: Payload) -> None:
        """Give the run that was set aside to the period before."""
        for rank, word in self._aside.items():
            before.words[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * (rank + 1)] = word
            before.fresh[rank] = True
        self._aside.clear()

    def _expect_late(self, behind: int, above: int = -1, is_of_before: bool = False) -> None:
        """The sender may be ``behind`` by so many runs.

        If it is only one, that has only ranks ``above``; and ``is_of_before``: it can only be of the period before.
        """
        self._behind = behind
        self._late_above = above
        self._is_of_before = is_of_before and behind == 1

    def _begin_next(self, rank: int) -> Lost | None:
        lost = None
        if self._is_suspect and self._is_of_before:
            self._set_aside()
            self.is_aside_proved = self._late_above >= 0  # a tail; a whole sweep may be of another period
        else:
            is_late = self._is_suspect or bool(self._aside) or rank in self._ranks
            lost = LossReason.LATE if is_late else LossReason.OUT_OF_ORDER, self.lose()
        self._expect_late(max(self._behind - 1, 0))
        self._is_suspect = self._behind > 0
        self.is_settled = False  # two runs in one period: the bus only seemed free
        return lost

    def _set_aside(self) -> None:
        words, fresh = self._payload
        self._aside = {rank: bytes(words[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * (rank + 1)])
                       for rank in self._own if fresh[rank]}
        self._clear()

    def _clear(self) -> None:
        self._payload.fresh[self._own] = False
        self._ranks.clear()
        self._is_suspect = False
