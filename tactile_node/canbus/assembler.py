"""Puts the TPDOs between two SYNCs together into one taxel frame. A pure state machine: no bus, no clock.

A skin sends its TPDOs in a fixed order every period (the layout's) and CAN keeps one sender's order, so the
TPDOs of one period form one *ascending run* of ranks. A taxel frame is only ever made of one run, of one run of
each node where several make up the pad (what follows holds for each node by itself):

- A rank not above the last one begins a new run: what came before it in this period belonged to an earlier
  one and is dropped (LATE; OUT_OF_ORDER where the run did not hold that rank, so nothing speaks of two
  periods). Only an immediate repetition with equal bytes is a mere DUPLICATE.
- After a period that ended early, ranks above its end may be its delayed tail; after a silent one, any may.
  Such a run is suspect: dropped (LATE) when a new run begins, and also when the next SYNC comes, since
  nothing proves it fresh. So the first sweep after silence is given up, even a whole one.
- When every node's run has all its ranks, the frame is complete and given at once. Otherwise the next SYNC
  gives the frame, with NaN and STALE for the taxels that are in no run, or none (``drop_incomplete``).
  Whatever follows a complete run within its period is SURPLUS.

Where TPDOs and SYNC are stamped by one clock (``one_clock``), a TPDO stamped before its SYNC is LATE by
proof: a driver that lags behind its bus drops frames rather than publish them under a later stamp.

Where several nodes make up a pad, a run that begins anew, not suspect, tells of a SYNC that was lost: nothing of any
node is then used until the next one (LATE).

So a frame mixes two periods only if a SYNC, the end of the period before it and the beginning of the one
after it are lost together; or if one of several nodes is late by a whole period at every SYNC, which nothing tells.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from tactile_node.canbus.layout import SkinLayout
from tactile_node.canbus.losses import Loss, LossReason, PadStatistics
from tactile_node.canbus.sender_run import SenderRun
from tactile_node.canbus.taxel_codec import TaxelCodec
from tactile_node.taxel_frame import TaxelFrame


class FrameAssembler:
    """The state machine of one pad. ``sync`` and ``feed`` return a TaxelFrame as soon as there is one.

    ``node_ids``: those of the pad's nodes, as many as the layout has.
    """

    service = 'tpdo'  #: of its CAN frames, for the counts

    def __init__(self, layout: SkinLayout, node_ids: Sequence[int], one_clock: bool = True,
                 drop_incomplete: bool = False):
        self.drop_incomplete = drop_incomplete
        self._codec, self._one_clock = TaxelCodec(layout), one_clock
        self._lengths = [tpdo.length for tpdo in layout.tpdos]
        self._payload, self._fresh = bytearray(8 * len(self._lengths)), np.zeros(len(self._lengths), bool)
        self._runs = [SenderRun([rank for rank, tpdo in enumerate(layout.tpdos) if tpdo.node == node], self._fresh)
                      for node in range(len(node_ids))]
        self._senders: dict[int, SenderRun] = {}  # by COB-ID
        self._ranks: dict[int, dict[bytes, int]] = {}  # COB-ID -> first bytes -> rank
        for rank, tpdo in enumerate(layout.tpdos):
            node_id = node_ids[tpdo.node]
            can_id = tpdo.cob_id.of(node_id)
            self._senders[can_id] = self._runs[tpdo.node]
            self._ranks.setdefault(can_id, {})[tpdo.prefix(node_id)] = rank
        self._heads = {can_id: len(next(iter(ranks))) for can_id, ranks in self._ranks.items()}
        self._counts: Counter[str] = Counter()
        self._losses: Counter[LossReason] = Counter()
        self._given = self._is_torn = False
        self.restart()

    @property
    def can_ids(self) -> frozenset[int]:
        return frozenset(self._ranks)

    def restart(self) -> None:
        """Forget the period under way; the next SYNC is number 0."""
        self._sequence = -1
        self.resume(0)

    def resume(self, lost_periods: int) -> None:
        """Forget the period under way; the next SYNC comes ``lost_periods`` numbers later than the next one."""
        self._losses[LossReason.UNFINISHED] += self._pending()
        self._sequence, self._stamp = self._sequence + lost_periods, None
        self._given = self._is_torn = False
        for run in self._runs:
            run.forget()

    def sync(self, timestamp: float) -> TaxelFrame | None:
        """A SYNC was on the bus: end the period and begin the next one; the ended frame, if not yet given."""
        ended = self.end_period()
        self._sequence, self._stamp = self._sequence + 1, timestamp
        self._given = self._is_torn = False
        for run in self._runs:
            run.begin_period()
        return ended

    def feed(self, can_id: int, data: bytes, timestamp: float) -> TaxelFrame | Loss | None:
        """One TPDO of this pad: the frame it completes, a loss, or None (taken, more to come)."""
        self._counts['received'] += 1
        head, run = self._heads[can_id], self._senders[can_id]
        rank = self._ranks[can_id].get(bytes(data[:head]))
        if rank is None:
            return self._lose(LossReason.SHORT if len(data) < head else LossReason.UNKNOWN_ROW)
        if self._stamp is None:
            return self._lose(LossReason.BEFORE_FIRST_SYNC)
        if self._one_clock and timestamp < self._stamp:
            run.came_late(rank)
            return self._lose(LossReason.LATE)
        if run.repeats(rank, data):
            return self._lose(LossReason.DUPLICATE)
        if len(self._runs) > 1 and not self._given and run.begins_anew(rank):
            self._tear()
        if self._is_torn:
            loss = self._lose(LossReason.LATE)
        elif self._given or run.is_complete:
            loss = self._lose(LossReason.SURPLUS)
        else:
            loss = self._place(run, rank, data)
        run.note(rank, data)
        if not self._given and not self._is_torn and run.is_complete and all(one.is_complete for one in self._runs):
            return self._give()
        return loss

    def end_period(self) -> TaxelFrame | None:
        """End the period without a next SYNC (end of a log); the frame, if it was not yet given."""
        if self._stamp is None:
            return None
        frame = None
        if not self._given:
            for unproved in filter(None, [run.end() for run in self._runs]):
                self._lose(LossReason.LATE, unproved)
            frame = self._give()
        self._stamp = None
        return frame

    def statistics(self) -> PadStatistics:
        counts, used = self._counts, tuple(run.used for run in self._runs)
        expected = (counts['complete'] + counts['incomplete'] + counts['dropped']) * len(self._lengths)
        return PadStatistics(
            counts['complete'], counts['incomplete'], expected, counts['received'], sum(used), self._pending(),
            {r.value: self._losses[r] for r in LossReason}, counts['dropped'], used)

    def _pending(self) -> int:
        return 0 if self._given else int(self._fresh.sum())

    def _tear(self) -> None:
        self._is_torn = True
        for dropped in filter(None, [run.drop() for run in self._runs]):
            self._lose(LossReason.LATE, dropped)

    def _place(self, run: SenderRun, rank: int, data: bytes) -> Loss | None:
        dropped = run.place(rank)
        if len(data) != self._lengths[rank]:
            if dropped is not None:
                self._lose(*dropped)
            return self._lose(LossReason.SHORT if len(data) < self._lengths[rank] else LossReason.OVER_LONG)
        self._payload[8 * rank:8 * rank + len(data)] = data
        self._fresh[rank] = True
        return None if dropped is None else self._lose(*dropped)

    def _give(self) -> TaxelFrame | None:
        self._given = True
        if self.drop_incomplete and not self._fresh.all():
            self._counts['dropped'] += 1
            self._lose(LossReason.INCOMPLETE, int(self._fresh.sum()))
            return None
        for run in self._runs:
            run.used += run.pending
        values, status = self._codec.decode(self._payload, self._fresh)
        self._counts['complete' if self._fresh.all() else 'incomplete'] += 1
        return TaxelFrame(self._stamp, self._sequence, values, status, int((~self._fresh).sum()))

    def _lose(self, reason: LossReason, can_frames: int = 1) -> Loss:
        self._losses[reason] += can_frames
        return Loss(reason, can_frames)
