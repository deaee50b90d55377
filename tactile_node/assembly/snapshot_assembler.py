"""Makes snapshots of a skin whose TPDOs come each at its own time. A pure state machine: no bus, no clock.

A snapshot holds the latest values of each TPDO and their ages. Its stamp is that of the newest TPDO in it, so ages are
never below 0, and stamps rise although TPDOs come at different rates. What a TPDO claims was acquired at stamp - age.

Rules
 1. A snapshot is given as soon as every TPDO has come since the one before; those whose values are already too old are
    not waited for.
 2. It is given before a TPDO is taken that would replace values in no snapshot yet, so that none is lost and the
    fastest TPDO sets the pace; and before one that comes more than SNAPSHOT_WAIT after the first new one.
 3. Taxels of a TPDO that is older than ``max_age``, or has not come yet, are NaN and STALE. A device repeats what has
    not changed after its event timer, so silence beyond ``max_age`` is a fault and never "unchanged".
 4. An immediate repetition with equal bytes, sooner than half the event timer, is a DUPLICATE and renews no age.
 5. With ``drop_incomplete`` a snapshot with STALE TPDOs is withheld. Its new TPDOs are lost (INCOMPLETE) unless the
    next one given still holds them.
 6. All values are forgotten when a stamp is more than ``max_age`` from the newest one: the pad was silent, or the clock
    was set. The next snapshot then waits for every TPDO, as the first one does.
 7. Of a node that was started the values are forgotten: it did not send, and may now send something else.
"""

from collections.abc import Sequence

import numpy as np

from tactile_node.assembly.frame_source import LossReason
from tactile_node.assembly.pad_assembler import Frames, PadAssembler
from tactile_node.cia301.objects import MAX_PDO_BYTES
from tactile_node.skin.layout import EventDriven, SkinLayout
from tactile_node.taxel_frame import TpdoAges, read_only

SNAPSHOT_WAIT = 0.02  #: s; the usual time between two sweeps with SYNC


class SnapshotAssembler(PadAssembler):
    """The state machine of one pad that sends as ``event`` says."""

    def __init__(self, layout: SkinLayout, event: EventDriven, node_ids: Sequence[int]):
        super().__init__(layout, node_ids)
        self._event = event
        self._node_ids = np.array([node_ids[tpdo.node] for tpdo in layout.tpdos])  # by rank
        self._taxel_tpdos = _taxel_tpdos(layout)
        size = len(layout.tpdos)
        self._words = bytearray(MAX_PDO_BYTES * size)
        self._unused = np.zeros(size, bool)  # in no frame given so far
        self.restart()

    def start(self, node_id: int) -> None:
        """The node's values are forgotten when the next TPDO comes."""
        self._started.add(node_id)

    def end_period(self) -> Frames:
        frames = self._give_new()
        self._forget()
        return frames

    def _feed_tpdo(self, rank: int, data: bytes, timestamp: float) -> Frames:
        if wrong := self._wrong_length(rank, data):
            return self._lose(wrong)
        frames = self._forget_invalid(timestamp)
        if self._is_duplicate(rank, data, timestamp):
            return frames + self._lose(LossReason.DUPLICATE)
        if self._is_new[rank] or timestamp - self._first_new > SNAPSHOT_WAIT:
            frames += self._give_new()
        self._take(rank, data, timestamp)
        if (self._is_new | self._is_too_old()).all():
            frames += self._give_new()
        return frames

    def _pending(self) -> int:
        return int(self._unused.sum())

    def _forget(self) -> None:
        self._lose(LossReason.UNFINISHED, self._pending())
        size = len(self._unused)
        self._unused = np.zeros(size, bool)
        self._is_new = np.zeros(size, bool)  # not in the snapshot before
        self._is_known = np.zeros(size, bool)
        self._stamps = np.full(size, np.nan)  # when the last TPDO of each rank came, or since when it may
        self._newest = self._first_new = np.inf
        self._last = -1, b''  # rank and bytes received last
        self._started: set[int] = set()  # node-IDs

    def _forget_invalid(self, stamp: float) -> Frames:
        """What was received before does not hold for what is stamped now."""
        frames: Frames = ()
        is_first = not self._is_known.any()
        if not is_first and abs(stamp - self._newest) > self._event.max_age:
            frames = self.end_period()
            is_first = True
        elif self._started:
            frames = self._give_new()
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
        """Whether the TPDO of each rank has not come for too long."""
        return np.greater(self._newest - self._stamps, self._event.max_age)

    def _give_new(self) -> Frames:
        """Give a snapshot, if anything is new."""
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
        return self._give_frame(self._newest, self._sequence, self._words, fresh, used, missing, ages)


def _taxel_tpdos(layout: SkinLayout) -> np.ndarray:
    """Return the rank of the TPDO of each taxel, uint16 (rows, cols), 0 where there is none."""
    ranks = np.zeros((layout.rows, layout.cols), np.uint16)
    for rank, tpdo in enumerate(layout.tpdos):
        for field in tpdo.taxels:
            ranks[field.row, field.col] = rank
    return read_only(ranks)
