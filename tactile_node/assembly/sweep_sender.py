"""Count how many sweeps one node may be behind. The module ``sync_assembler`` states the rules."""

from collections.abc import Sequence
from math import inf


class SweepSender:
    """One node of a pad.

    Parameters
    ----------
    ranks : sequence of int
        Ranks of the node's TPDOs, ascending.

    Attributes
    ----------
    owes_tail : bool
        True if, of all earlier sweeps, only the end of the previous one may still arrive, after the rank ``last``.
    last : int
        Rank received last, or -1 before the first TPDO of a run.
    waiting : dict
        TPDOs of the present run, by rank, while the SYNC that they answer is not known.
    received : list of int
        Ranks received in this period, at most one more than in a sweep.
    order : list of int or None
        Ranks in the order in which the node sends them, if this order differs from the layout.
    is_in_doubt : bool
        True if the node sends, but the driver does not know which SYNC the node is answering.
    """

    def __init__(self, ranks: Sequence[int]):
        self.ranks = list(ranks)
        self.order: list[int] | None = None
        self.restart()

    def restart(self, behind: float = 0) -> None:
        """Forget all TPDOs. The node may be ``behind`` by this number of sweeps; inf if the number is unknown."""
        self._behind = behind  # largest number of earlier sweeps whose TPDOs may still arrive; inf if unknown
        self.owes_tail = False
        self.last = -1
        self.waiting: dict[int, bytes] = {}
        self.received: list[int] = []
        self.is_in_doubt = False
        self._last_data = b''
        self._bus_was_free = False  # True if a free bus has proved that the next run answers the last SYNC
        self._was_started = False
        self._began_in_step = self.is_in_step

    @property
    def is_in_step(self) -> bool:
        """True if no TPDO of an earlier sweep may still arrive, so that the node answers the last SYNC (rule 1)."""
        return not self._behind

    def started(self) -> None:
        """Record that the silent node was started. The node owes no answer to an earlier SYNC (rule 2)."""
        if not self.received:
            self.restart()
            self._was_started = True

    def bus_was_free(self) -> None:
        """Record that a free bus has proved that no answer to an earlier SYNC can begin (rule 4).

        A tail is unaffected, because the beginning of the next run shows where the tail belongs.
        """
        if not self.received and not self.owes_tail:
            self._bus_was_free = True
            self.is_in_doubt = False

    def repeats(self, rank: int, data: bytes) -> bool:
        """Return True if a TPDO repeats the previous TPDO byte for byte (rule 6)."""
        return rank == self.last and data == self._last_data

    def note(self, rank: int, data: bytes) -> None:
        """Record that a TPDO was received, whether or not it is used."""
        self.last = rank
        self._last_data = data
        if len(self.received) <= len(self.ranks):  # without SYNC a period never ends, so the list must be limited
            self.received.append(rank)

    def note_earlier(self, rank: int, data: bytes) -> None:
        """Record a TPDO that was on the bus before the last SYNC, so that at least one sweep was behind (rule 9)."""
        if rank <= self.last:
            self.owes_tail = False
            self._behind -= 1
        self._behind = max(self._behind, 1)
        self.last = rank
        self._last_data = data
        if rank == self.ranks[-1]:
            self.owes_tail = False
            self._behind -= 1
            self.last = -1

    def began_further_run(self) -> None:
        """Record that the next run begins in the same period, so the node is one sweep less behind (rule 2)."""
        self._bus_was_free = False
        self.owes_tail = False
        self._behind -= 1

    def changed_order(self) -> None:
        """Record that the TPDOs arrived in another order.

        It is unknown how many sweeps the node is behind, until the bus is free (rule 5).
        """
        self._bus_was_free = False
        self._behind = inf

    def end_period(self) -> bool:
        """Pass to the next period, and return True if the run answers the SYNC of the ending period (rules 1 to 4)."""
        self._note_order()
        is_seen = bool(self.received)
        is_current = is_seen and (self._bus_was_free or self.is_in_step)
        if is_current:
            self._behind = 0
        if is_seen:
            has_ended = self.last == self.ranks[-1]
        else:
            has_ended = self._was_started
        if not has_ended:
            self._behind += 1
        self.owes_tail = is_current and not has_ended
        # a node that sends in another order stays behind, and a pause would not change that
        self.is_in_doubt = is_seen and not is_current and self.order is None
        if not self.owes_tail:
            self.last = -1
        self.received = []
        self._bus_was_free = False
        self._was_started = False
        self._began_in_step = self.is_in_step
        return is_current

    def _note_order(self) -> None:
        """Record the order in which the TPDOs arrived, if each TPDO arrived once.

        The end of a late sweep and the beginning of the next one look like a changed order. A changed order is
        therefore noted only if the node was in step when the period began.
        """
        if self.received == self.ranks:
            self.order = None
        elif self._began_in_step and sorted(self.received) == self.ranks:
            self.order = self.received
