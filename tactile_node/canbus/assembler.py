"""Puts the TPDOs between two SYNCs together into one taxel frame. A pure state machine: no bus, no clock.

A skin sends its TPDOs in a fixed order every period (the layout's) and CAN keeps one sender's order, so the
TPDOs of one period form one *ascending run* of ranks. A taxel frame is only ever made of one run:

- A rank not above the last one begins a new run: what came before it in this period belonged to an earlier
  one and is dropped (LATE; OUT_OF_ORDER where the run did not hold that rank, so nothing speaks of two
  periods). Only an immediate repetition with equal bytes is a mere DUPLICATE.
- After a period that ended early, ranks above its end may be its delayed tail; after a silent one, any may.
  Such a run is suspect: dropped (LATE) when a new run begins, and also when the next SYNC comes, since
  nothing proves it fresh. So the first sweep after silence is given up, even a whole one.
- A run of all ranks is a complete frame, given at once. Otherwise the next SYNC gives the frame, with NaN and
  STALE for the taxels that are not in the run, or none (``drop_incomplete``). Whatever follows a complete run
  within its period is SURPLUS.

Where TPDOs and SYNC are stamped by one clock (``one_clock``), a TPDO stamped before its SYNC is LATE by
proof: a driver that lags behind its bus drops frames rather than publish them under a later stamp.

So a frame mixes two periods only if a SYNC, the end of the period before it and the beginning of the one
after it are lost together.
"""

from collections import Counter
from enum import Enum
from typing import NamedTuple

import numpy as np

from tactile_node.canbus.layout import SkinLayout
from tactile_node.canbus.taxel_codec import TaxelCodec
from tactile_node.taxel_frame import TaxelFrame


class LossReason(str, Enum):
    """Why a TPDO of a pad went into no taxel frame."""

    BEFORE_FIRST_SYNC = 'before_first_sync'
    OUT_OF_ORDER = 'out_of_order'  #: a TPDO that comes before these in a sweep came after them
    LATE = 'late'  #: of an earlier period, or possibly so
    DUPLICATE = 'duplicate'  #: the same COB-ID and bytes twice in a row
    SURPLUS = 'surplus'  #: after the period's frame was complete
    SHORT = 'short'  #: fewer bytes than mapped
    UNKNOWN_ROW = 'unknown_row'  #: a row number, or an MPDO, that the layout does not name
    OVER_LONG = 'over_long'  #: more bytes than mapped: the device maps something else
    INCOMPLETE = 'incomplete'  #: good, of a sweep that was dropped since others were missing
    UNFINISHED = 'unfinished'  #: the driver stopped within the period


class Loss(NamedTuple):
    reason: LossReason
    can_frames: int = 1


class PadStatistics(NamedTuple):
    """Counts of one pad since it was opened; every TPDO received is used, lost with a reason, or pending."""

    complete: int  #: taxel frames given with every TPDO
    incomplete: int  #: taxel frames given with NaN
    expected: int  #: TPDOs that these taxel frames should have brought
    received: int  #: TPDOs seen, good or not
    used: int  #: TPDOs whose taxels were given as valid
    pending: int  #: TPDOs of the period under way
    losses: dict[str, int]  #: TPDOs dropped, by LossReason
    dropped: int = 0  #: incomplete taxel frames dropped, as asked for

    @property
    def published(self) -> int:
        """Taxel frames given, complete or not: one for each SYNC period."""
        return self.complete + self.incomplete

    @property
    def missing(self) -> int:
        """TPDOs expected that brought no valid taxels."""
        return self.expected - self.used


class FrameAssembler:
    """The state machine of one pad. ``sync`` and ``feed`` return a TaxelFrame as soon as there is one."""

    def __init__(self, layout: SkinLayout, node_id: int, one_clock: bool = True,
                 drop_incomplete: bool = False):
        self._drop_incomplete = drop_incomplete
        self._codec, self._one_clock = TaxelCodec(layout), one_clock
        self._ranks: dict[int, dict[bytes, int]] = {}  # COB-ID -> first bytes -> rank
        for rank, tpdo in enumerate(layout.tpdos):
            self._ranks.setdefault(tpdo.cob_id.of(node_id), {})[tpdo.prefix(node_id)] = rank
        self._heads = {can_id: len(next(iter(ranks))) for can_id, ranks in self._ranks.items()}
        self._lengths = [tpdo.length for tpdo in layout.tpdos]
        self._payload = bytearray(8 * len(self._lengths))
        self._counts: Counter[str] = Counter()
        self._losses: Counter[LossReason] = Counter()
        self._given, self._seen, self._fresh = False, True, np.zeros(len(self._lengths), bool)
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
        self._last, self._last_data = len(self._lengths) - 1, b''
        self._begin_period()
        self._seen = True  # as after a whole period: nothing of an earlier one is to come

    def sync(self, timestamp: float) -> TaxelFrame | None:
        """A SYNC was on the bus: end the period and begin the next one; the ended frame, if not yet given."""
        ended = self.end_period()
        self._sequence, self._stamp = self._sequence + 1, timestamp
        self._begin_period()
        return ended

    def feed(self, can_id: int, data: bytes, timestamp: float) -> TaxelFrame | Loss | None:
        """One TPDO of this pad: the frame it completes, a loss, or None (taken, more to come)."""
        self._counts['received'] += 1
        head = self._heads[can_id]
        rank = self._ranks[can_id].get(bytes(data[:head]))
        if rank is None:
            return self._lose(LossReason.SHORT if len(data) < head else LossReason.UNKNOWN_ROW)
        if self._stamp is None:
            return self._lose(LossReason.BEFORE_FIRST_SYNC)
        if self._one_clock and timestamp < self._stamp:
            self._previous_end = rank
            return self._lose(LossReason.LATE)
        if self._seen and rank == self._last and data == self._last_data:
            return self._lose(LossReason.DUPLICATE)
        loss = self._lose(LossReason.SURPLUS) if self._given else self._place(rank, data)
        self._last, self._last_data, self._seen = rank, bytes(data), True
        if self._run == len(self._lengths) and not (self._given or self._suspect):
            return self._give()
        return loss

    def end_period(self) -> TaxelFrame | None:
        """End the period without a next SYNC (end of a log); the frame, if it was not yet given."""
        if self._stamp is None:
            return None
        if self._suspect:
            self._drop_run()
        frame = None if self._given else self._give()
        self._stamp = None
        return frame

    def statistics(self) -> PadStatistics:
        counts, pending = self._counts, self._pending()
        expected = (counts['complete'] + counts['incomplete'] + counts['dropped']) * len(self._lengths)
        return PadStatistics(
            counts['complete'], counts['incomplete'], expected, counts['received'], counts['used'], pending,
            {r.value: self._losses[r] for r in LossReason}, counts['dropped'])

    def _pending(self) -> int:
        return 0 if self._given else int(self._fresh.sum())

    def _begin_period(self) -> None:
        self._fresh, self._ranks_seen = np.zeros((2, len(self._lengths)), bool)
        self._run = 0  # TPDOs in the run under way
        self._previous_end = self._last if self._seen else -1  # last rank of the period before
        self._seen = self._given = self._suspect = False

    def _place(self, rank: int, data: bytes) -> Loss | None:
        loss = None
        if not self._seen:
            self._suspect = rank > self._previous_end
        elif rank <= self._last:
            repeated = self._ranks_seen[rank]
            loss = self._drop_run(LossReason.LATE if self._suspect or repeated else LossReason.OUT_OF_ORDER)
        self._run += 1
        self._ranks_seen[rank] = True
        if len(data) != self._lengths[rank]:
            return self._lose(LossReason.SHORT if len(data) < self._lengths[rank] else LossReason.OVER_LONG)
        self._payload[8 * rank:8 * rank + len(data)] = data
        self._fresh[rank] = True
        return loss

    def _drop_run(self, reason: LossReason = LossReason.LATE) -> Loss:
        dropped = int(self._fresh.sum())
        self._fresh[:] = self._ranks_seen[:] = False
        self._run, self._suspect = 0, False
        return self._lose(reason, dropped)

    def _give(self) -> TaxelFrame | None:
        if self._drop_incomplete and not self._fresh.all():
            self._given = True
            self._counts['dropped'] += 1
            self._lose(LossReason.INCOMPLETE, int(self._fresh.sum()))
            return None
        values, status = self._codec.decode(self._payload, self._fresh)
        self._given = True
        self._counts['used'] += int(self._fresh.sum())
        self._counts['complete' if self._fresh.all() else 'incomplete'] += 1
        return TaxelFrame(self._stamp, self._sequence, values, status, int((~self._fresh).sum()))

    def _lose(self, reason: LossReason, can_frames: int = 1) -> Loss:
        self._losses[reason] += can_frames
        return Loss(reason, can_frames)
