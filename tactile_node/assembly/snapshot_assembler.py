"""Assemble snapshots of a skin whose TPDOs are sent independently.

The assembler is a pure state machine without access to a bus or a clock.

A snapshot holds the latest values of each TPDO and their ages. The stamp of a snapshot is the stamp of its newest TPDO.
Ages are therefore never negative, and stamps rise even if TPDOs are sent at different rates. The device acquired the
values of a TPDO at the stamp of the snapshot minus their age.

The assembler follows these rules:

 1. A snapshot is emitted as soon as every TPDO has been received since the previous snapshot. The assembler does not
    wait for TPDOs whose values are already too old.

 2. A snapshot is also emitted before a TPDO replaces values that no snapshot contains yet. With this rule, no value is
    lost, and the fastest TPDO sets the snapshot rate. A snapshot is also emitted before a TPDO that arrives more than
    SNAPSHOT_WAIT after the first new TPDO.

 3. If a TPDO is older than ``max_age`` or was never received, its taxels are NaN and STALE. A device repeats unchanged
    values when its event timer expires, so silence beyond ``max_age`` is a fault and never means "unchanged".

 4. A TPDO that repeats the previous TPDO byte for byte within half the event timer's interval is a DUPLICATE. A
    DUPLICATE does not renew the age.

 5. With ``drop_incomplete``, a snapshot with STALE TPDOs is withheld. The new TPDOs of a withheld snapshot are lost
    (INCOMPLETE) unless the next emitted snapshot still holds them.

 6. If a stamp differs from the newest stamp by more than ``max_age``, the assembler forgets all values, because the pad
    was silent or the clock was set. The next snapshot waits for every TPDO, as the first one does.

 7. When a node is started, the assembler forgets the node's values, because they may have changed while the node was
    silent.
"""

from collections.abc import Sequence

import numpy as np

from tactile_node.assembly.facts import LossReason
from tactile_node.assembly.pad_assembler import PadAssembler, TaxelFrames
from tactile_node.cia301.objects import MAX_PDO_BYTES
from tactile_node.skin.layout import EventDriven, SkinLayout
from tactile_node.taxel_frame import TpdoAges, read_only

SNAPSHOT_WAIT = 0.02  #: Longest wait for further TPDOs [s]; equal to the usual time between two sweeps with SYNC.


class SnapshotAssembler(PadAssembler):
    """The state machine of one pad that sends each TPDO on its own.

    The arguments are those of `PadAssembler`, and ``event``, the timing of the pad's transmissions.
    """

    def __init__(self, layout: SkinLayout, event: EventDriven, node_ids: Sequence[int]):
        super().__init__(layout, node_ids)
        self._event = event
        self._node_ids = np.array([node_ids[tpdo.node] for tpdo in layout.tpdos])  # node-ID by rank
        self._taxel_tpdos = _taxel_tpdos(layout)
        size = len(layout.tpdos)
        self._words = bytearray(MAX_PDO_BYTES * size)
        self._unused = np.zeros(size, bool)  # True by rank for values that no emitted frame contains
        self.restart()

    def node_started(self, node_id: int) -> None:
        """Record that a node was started. The assembler forgets the node's values when the next TPDO arrives."""
        self._started.add(node_id)

    def end_period(self) -> TaxelFrames:
        frames = self._emit_new()
        self._forget()
        return frames

    def _feed_tpdo(self, rank: int, data: bytes, stamp: float) -> TaxelFrames:
        if wrong := self._wrong_length(rank, data):
            return self._lose(wrong)
        frames = self._forget_invalid(stamp)
        if self._is_duplicate(rank, data, stamp):
            return frames + self._lose(LossReason.DUPLICATE)
        if self._is_new[rank] or stamp - self._first_new > SNAPSHOT_WAIT:
            frames += self._emit_new()
        self._take(rank, data, stamp)
        if (self._is_new | self._is_too_old()).all():
            frames += self._emit_new()
        return frames

    def _pending(self) -> int:
        return int(self._unused.sum())

    def _forget(self) -> None:
        self._lose(LossReason.UNFINISHED, self._pending())
        size = len(self._unused)
        self._unused = np.zeros(size, bool)
        self._is_new = np.zeros(size, bool)  # True by rank for values newer than the last snapshot
        self._is_known = np.zeros(size, bool)
        self._stamps = np.full(size, np.nan)  # time of the last TPDO, or the time since which it is awaited, by rank
        self._newest = self._first_new = np.inf
        self._last = -1, b''  # rank and bytes of the last TPDO
        self._started: set[int] = set()  # node-IDs

    def _forget_invalid(self, stamp: float) -> TaxelFrames:
        """Forget the values that are no longer valid at ``stamp``, and return the snapshot that holds them."""
        frames: TaxelFrames = ()
        is_first = not self._is_known.any()
        if not is_first and abs(stamp - self._newest) > self._event.max_age:
            frames = self.end_period()
            is_first = True
        elif self._started:
            frames = self._emit_new()
            forgotten = np.isin(self._node_ids, list(self._started))
            self._lose(LossReason.INCOMPLETE, int((self._unused & forgotten).sum()))
            self._unused &= ~forgotten
            self._is_known &= ~forgotten
            self._stamps[forgotten] = stamp
            self._started = set()
        if is_first:
            self._stamps[:] = stamp
            self._newest = stamp
        return frames

    def _is_duplicate(self, rank: int, data: bytes, stamp: float) -> bool:
        return (self._last == (rank, data) and bool(self._is_known[rank])
                and 0 <= stamp - self._stamps[rank] < self._event.event_timer / 2)

    def _take(self, rank: int, data: bytes, stamp: float) -> None:
        self._last = rank, data
        self._lose(LossReason.INCOMPLETE, int(self._unused[rank]))
        self._words[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * rank + len(data)] = data
        self._stamps[rank] = stamp
        self._is_known[rank] = self._is_new[rank] = self._unused[rank] = True
        self._newest = max(self._newest, stamp)
        self._first_new = min(self._first_new, stamp)

    def _is_too_old(self) -> np.ndarray:
        """Return, for each rank, True if the last TPDO is older than ``max_age``."""
        return np.greater(self._newest - self._stamps, self._event.max_age)

    def _emit_new(self) -> TaxelFrames:
        """Return a snapshot if any value is new, otherwise an empty tuple."""
        if not self._is_new.any():
            return ()
        fresh = self._is_known & ~self._is_too_old()
        missing = int((~fresh).sum())
        self._is_new[:] = False
        self._first_new = np.inf
        self._sequence += 1
        if missing and self.drop_incomplete:
            self._count_withheld(missing)
            return ()
        self._lose(LossReason.INCOMPLETE, int((self._unused & ~fresh).sum()))
        used, self._unused = self._unused & fresh, np.zeros(len(fresh), bool)
        ages = TpdoAges(read_only((self._newest - self._stamps).astype(np.float32)), self._taxel_tpdos)
        return self._emit_frame(self._newest, self._sequence, self._words, fresh, used, missing, ages)


def _taxel_tpdos(layout: SkinLayout) -> np.ndarray:
    """Return the rank of the TPDO that carries each taxel, uint16 (rows, cols); 0 for a taxel without a TPDO."""
    ranks = np.zeros((layout.rows, layout.cols), np.uint16)
    for rank, tpdo in enumerate(layout.tpdos):
        for field in tpdo.taxels:
            ranks[field.row, field.col] = rank
    return read_only(ranks)
