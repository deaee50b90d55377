"""Follow one sender through the sweep of one period.

A sender is one CANopen node of a pad. The module ``assembler`` states the rules.

                  not behind
    EMPTY ----------------------------> CURRENT ---.
      |                                    ^  ^    |  next run: this run is lost
      | may be behind                      |  '----'
      v                                    |
    SUSPECT -------------------------------'
      |   next run: the sender is one run less behind; this run is moved to the previous period, or is lost (LATE)
      |   (the state stays SUSPECT if the sender was behind by more than one run)
      '-- SYNC: this run is lost (LATE), because nothing proves that it belongs to this period

If a free bus proves that nothing is late (settle), SUSPECT becomes CURRENT at the next SYNC, because no second run
followed.

The previous period determines how many more runs the sender is behind when a period begins:

  - If the previous period ended with the last rank, no run is added.

  - If the previous period ended early, one run is added. The late run may contain the ranks above the last rank
    received.

  - If the previous period was silent, one run is added. The late run may contain any ranks.

  - If the sender was started in the previous period, no run is added, and all earlier runs are forgotten.

If the previous period ended SUSPECT or was silent, the number of late runs from that period is added.
"""

from typing import NamedTuple

import numpy as np

from tactile_node.assembly.frame_source import LossReason
from tactile_node.cia301.objects import MAX_PDO_BYTES


class Payload(NamedTuple):
    """The TPDOs of one period, by rank."""

    words: bytearray  #: MAX_PDO_BYTES bytes for each TPDO
    fresh: np.ndarray  #: bool, True for each TPDO received for the period


Lost = tuple[LossReason, int]  #: Reason for a loss, and number of TPDOs lost.


class SenderRun:
    """The TPDOs of one sender in one period.

    Parameters
    ----------
    own : np.ndarray
        Ranks of the sender, ascending.
    payload : Payload
        TPDOs of the period, shared by all senders of the pad.
    before : SenderRun or None
        Run of the same sender in the previous period; None if no TPDO of an earlier period can arrive any more.
    """

    def __init__(self, own: np.ndarray, payload: Payload, before: 'SenderRun | None'):
        self._own = own
        self._payload = payload
        self._top = int(own[-1])
        self._ranks: set[int] = set()  # ranks received in the present run
        self.last = -1  #: rank received last
        self._last_data = b''
        self._aside: dict[int, bytes] = {}  # a suspect run, set aside when the sender began the next run

        #: True if the run set aside is the tail of a sweep, so it belongs to the previous period
        self.is_aside_proved = False
        self.received: list[int] = []  #: ranks in order of reception; at most one more than in a sweep
        self.is_seen = False  #: True if any TPDO was received
        self._is_suspect = False
        self._ended_suspect = False
        self._is_doubted = False  # True if a whole period has passed without showing whether the sender is behind
        self._was_started = False
        self.is_settled = False  #: True if a free bus has proved that the sender is not behind
        self._was_silent = False  # True if no TPDO was received in the previous period
        self._expect_late(0)
        if before is not None:
            self.carry_over(before)

    def carry_over(self, before: 'SenderRun') -> None:
        """Compute how many late runs may arrive before the run of this period.

        Parameters
        ----------
        before : SenderRun
            Run of the same sender in the previous period.
        """
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
        """True if all TPDOs of the sender were received and the run is not suspect."""
        return len(self._ranks) == len(self._own) and not self._is_suspect

    @property
    def is_position_unknown(self) -> bool:
        """True if, at the end of the period, the driver does not know which sweep the sender was sending."""
        return self._ended_suspect if self.is_seen else self._behind > 0

    @property
    def may_be_continued(self) -> bool:
        """True if missing TPDOs may arrive in the next period and will then be known to belong to this period."""
        return not self.is_position_unknown and self.last < self._top

    @property
    def is_in_doubt(self) -> bool:
        """True if the sender is sending, but a whole period has passed without showing whether the sender is behind."""
        return self._is_doubted and not self._was_silent

    @property
    def is_undecided(self) -> bool:
        """True if the TPDOs received so far, or the next TPDOs, may belong to the previous period."""
        return not self.is_seen or self._is_suspect or bool(self._aside)

    @property
    def used(self) -> int:
        """Number of the sender's TPDOs that a frame would contain now."""
        return int(self._payload.fresh[self._own].sum())

    @property
    def pending(self) -> int:
        """Number of TPDOs that may still be used or lost."""
        return self.used + len(self._aside)

    def start(self) -> None:
        """Record that the silent sender was started and is therefore not behind."""
        self._was_started = True
        if not self.is_seen:
            self._expect_late(0)

    def settle(self) -> None:
        """Record that no run of an earlier period can still begin.

        A delayed tail is unaffected, because the beginning of the next run proves where the tail belongs.
        """
        if not self.is_seen and self._late_above < 0:
            self.is_settled = True
            self._is_doubted = False

    def assume_behind(self) -> None:
        """Treat the first run as possibly late, because the sender's earlier TPDOs are unknown."""
        self._expect_late(1)

    def note_late(self, rank: int) -> None:
        """Record a TPDO of an earlier period that arrived too late to be used.

        A TPDO that is too late only shows how far the sender has got.
        """
        if self.is_seen:
            if rank <= self.last:
                self._expect_late(max(self._behind - 1, 0))
            self.last = rank
        elif self._behind == 0:
            self._expect_late(int(rank < self._top), rank)
        elif rank == self._top:
            self._expect_late(self._behind - 1)

    def repeats(self, rank: int, data: bytes) -> bool:
        """Return True if a TPDO repeats the previous TPDO byte for byte."""
        return self.is_seen and rank == self.last and data == self._last_data

    def begins_next_sweep(self, rank: int) -> bool:
        """Return True if ``rank`` begins another sweep and the present run is not suspect."""
        return self.is_seen and rank <= self.last and not self._is_suspect

    def add(self, rank: int) -> Lost | None:
        """Add a TPDO to the present run, or begin the next run with it.

        Parameters
        ----------
        rank : int
            Rank of the TPDO.

        Returns
        -------
        tuple or None
            Reason for the loss of the present run and the number of its TPDOs; None if nothing is lost.
        """
        lost = None
        if not self.is_seen:
            # a new run has begun, so the delayed tail can no longer arrive
            if self._behind == 1 and rank <= self._late_above:
                self._expect_late(0)
            self._is_suspect = self._behind > 0
        elif rank <= self.last:
            lost = self._begin_next(rank)
        self._ranks.add(rank)
        return lost

    def note_received(self, rank: int, data: bytes) -> None:
        """Record that a TPDO was received, whether or not it is used."""
        self.last = rank
        if len(self.received) <= len(self._own):  # without SYNC a period never ends, so the list must be limited
            self.received.append(rank)
        self._last_data = bytes(data)
        self.is_seen = True

    def end(self) -> int:
        """End the period, discard the TPDOs whose period is not proved, and return the number discarded."""
        if self.is_settled:
            self._is_suspect = False
        self._ended_suspect = self._is_suspect
        return self.lose() if self._is_suspect else self.lose_aside()

    def lose(self) -> int:
        """Discard all TPDOs of the period so far, and return their number."""
        lost = self.used + self.lose_aside()
        self._clear()
        return lost

    def lose_aside(self) -> int:
        """Discard the run that was set aside, and return the number of its TPDOs."""
        lost = len(self._aside)
        self._aside.clear()
        return lost

    def return_aside(self, before: Payload) -> None:
        """Move the run that was set aside back to the payload of the previous period."""
        for rank, word in self._aside.items():
            before.words[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * (rank + 1)] = word
            before.fresh[rank] = True
        self._aside.clear()

    def _expect_late(self, behind: int, above: int = -1, is_of_before: bool = False) -> None:
        """Record that the sender may be behind by ``behind`` runs.

        If the sender is behind by one run, that run contains only ranks above ``above``. With ``is_of_before``, the
        late run can only belong to the previous period.
        """
        self._behind = behind
        self._late_above = above
        self._is_of_before = is_of_before and behind == 1

    def _begin_next(self, rank: int) -> Lost | None:
        lost = None
        if self._is_suspect and self._is_of_before:
            self._set_aside()
            # True for the tail of a sweep; a whole sweep may belong to another period
            self.is_aside_proved = self._late_above >= 0
        else:
            is_late = self._is_suspect or bool(self._aside) or rank in self._ranks
            lost = LossReason.LATE if is_late else LossReason.OUT_OF_ORDER, self.lose()
        self._expect_late(max(self._behind - 1, 0))
        self._is_suspect = self._behind > 0
        self.is_settled = False  # a second run in one period shows that the bus only seemed to be free
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
