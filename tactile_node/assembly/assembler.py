"""Puts the TPDOs between two SYNCs together into one taxel frame. A pure state machine: no bus, no clock.

A skin sends its TPDOs in a fixed order every period (the layout's) and CAN keeps one sender's order, so the
TPDOs of one period form one *ascending run* of ranks. A taxel frame is only ever made of one run, of one run of
each node where several make up the pad (what follows holds for each node by itself):

- A rank not above the last one begins a new run: what came before it in this period belonged to an earlier
  one and is dropped (LATE; OUT_OF_ORDER where the run did not hold that rank, so nothing speaks of two
  periods). Only an immediate repetition with equal bytes is a mere DUPLICATE.
- After a period that ended early, ranks above its end may be its delayed tail; after a silent one, any may.
  Such a run is suspect. When a whole run follows it before the next SYNC, it was of the period before, which gets it
  back. Else it is dropped (LATE), since nothing proves it fresh. So after n silent periods n runs are given up, even
  whole ones, if they come within one period; else those of CATCHING_UP periods: what has not come by then is lost,
  not late. A node that was started (``start``) owes nothing.
- When every node's run has all its ranks, the frame is complete and given at once. Otherwise it is given, with NaN and
  STALE for the taxels that are in no run, or not (``drop_incomplete``), as soon as nothing more of it can come: at the
  next SYNC, at the begin of the next run, or one SYNC later.
  Whatever follows a complete run within its period is SURPLUS.

Where TPDOs and SYNC are stamped by one clock (``one_clock``), a TPDO stamped before its SYNC is of the period before
by proof, or LATE: a driver that lags behind its bus never publishes frames under a later stamp.

Where several nodes make up a pad, a run that begins anew, not suspect, tells of a SYNC that was lost: nothing of any
node is then used until the next one (LATE).

So a frame mixes two periods only if a SYNC, the end of one sweep and the beginning of the next one are lost within
two periods. A sender that is late over CATCHING_UP SYNCs in a row is told by nothing from then on: until it catches up,
its frames are stamped a period late, and mix two periods where another node of the pad is not behind, or where the
end of one sweep and the beginning of the next one are lost.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from tactile_node.assembly.sweep_period import SweepPeriod
from tactile_node.cia301.pdo import MAX_PDO_BYTES
from tactile_node.frames.losses import Loss, LossReason, PadStatistics, Results
from tactile_node.frames.taxel_frame import TaxelFrame
from tactile_node.skin.layout import SkinLayout
from tactile_node.skin.taxel_codec import TaxelCodec


class FrameAssembler:
    """The state machine of one pad. ``sync`` and ``feed`` return taxel frames as soon as there are any, and losses.

    ``node_ids``: those of the pad's nodes, as many as the layout has.
    """

    service = 'tpdo'  #: of its CAN frames, for the counts

    def __init__(self, layout: SkinLayout, node_ids: Sequence[int], one_clock: bool = True,
                 drop_incomplete: bool = False):
        self.drop_incomplete = drop_incomplete
        self._codec, self._one_clock = TaxelCodec(layout), one_clock
        self._lengths = [tpdo.length for tpdo in layout.tpdos]
        self._owns = [np.array([rank for rank, tpdo in enumerate(layout.tpdos) if tpdo.node == node])
                      for node in range(len(node_ids))]
        self._ranks: dict[int, dict[bytes, int]] = {}  # COB-ID -> first bytes -> rank
        for rank, tpdo in enumerate(layout.tpdos):
            node_id = node_ids[tpdo.node]
            self._ranks.setdefault(tpdo.cob_id.of(node_id), {})[tpdo.prefix(node_id)] = rank
        self._nodes = [tpdo.node for tpdo in layout.tpdos]  # by rank
        self._node_ids = tuple(node_ids)
        self._heads = {can_id: len(next(iter(ranks))) for can_id, ranks in self._ranks.items()}
        self._counts: Counter[str] = Counter()
        self._used = [0] * len(node_ids)
        self._losses: Counter[LossReason] = Counter()
        self._before: SweepPeriod | None = None  # not yet given: its end may still come
        self._period: SweepPeriod | None = None
        self.restart()

    @property
    def can_ids(self) -> frozenset[int]:
        return frozenset(self._ranks)

    def restart(self) -> None:
        """Forget what is under way, the nodes are silent; the next SYNC is number 0."""
        self._forget()
        self._sequence, self._is_trusting = -1, True

    def resume(self, lost_periods: int) -> None:
        """After an outage: forget what is under way, leave out ``lost_periods`` sequence numbers.

        What its nodes still have to send is not known, until they are told to ``start``.
        """
        self._forget()
        self._sequence += lost_periods
        self._is_trusting = False

    def start(self, node_id: int) -> None:
        """This node, which did not send, was told to: nothing of an earlier period is to come from it."""
        if self._period is not None and node_id in self._node_ids:
            self._period.runs[self._node_ids.index(node_id)].start()

    def sync(self, timestamp: float) -> Results:
        """A SYNC was on the bus: end the period and begin the next one; the frames that get nothing more."""
        ended, period = self._close_before(), self._period
        if period is not None and not period.is_given:
            ended += self._end(period)
            if period.may_be_continued:
                self._before = period
            else:
                ended += self._give(period)
        self._sequence += 1
        self._period = SweepPeriod(self._sequence, timestamp, self._owns, period)
        if not self._is_trusting:
            self._is_trusting = True
            self._period.distrust()
        return ended

    def feed(self, can_id: int, data: bytes, timestamp: float) -> Results:
        """One TPDO of this pad: the frames it completes, losses, or nothing (taken, more to come)."""
        self._counts['received'] += 1
        head, period = self._heads[can_id], self._period
        rank = self._ranks[can_id].get(bytes(data[:head]))
        if rank is None:
            return self._lose(LossReason.SHORT if len(data) < head else LossReason.UNKNOWN_ROW)
        if period is None:
            return self._lose(LossReason.BEFORE_FIRST_SYNC)
        if self._one_clock and timestamp < period.stamp:
            return self._feed_before(period, rank, data, timestamp)
        outcome = self._take(period, rank, data)
        if period.runs[self._nodes[rank]].is_complete and period.is_complete:
            return outcome + self._settle(period) + self._give(period)
        if self._before is not None and not period.tells_of(self._before):
            return outcome + self._close_before()
        return outcome

    def end_period(self) -> Results:
        """End the period without a next SYNC (end of a log); the frames not yet given."""
        ended, period = self._close_before(), self._period
        if period is not None and not period.is_given:
            ended += self._end(period) + self._give(period)
        self._period = None
        return ended

    def statistics(self) -> PadStatistics:
        counts = self._counts
        expected = (counts['complete'] + counts['incomplete'] + counts['withheld']) * len(self._lengths)
        return PadStatistics(
            counts['complete'], counts['incomplete'], expected, counts['received'], sum(self._used), self._pending(),
            {reason: self._losses[reason] for reason in LossReason}, counts['withheld'], tuple(self._used))

    def _forget(self) -> None:
        self._losses[LossReason.UNFINISHED] += self._pending()
        self._before = self._period = None

    def _pending(self) -> int:
        return sum(period.pending for period in (self._before, self._period) if period is not None)

    def _feed_before(self, period: SweepPeriod, rank: int, data: bytes, timestamp: float) -> Results:
        """A TPDO that was on the bus before the last SYNC."""
        before, run = self._before, period.runs[self._nodes[rank]]
        if run.is_seen:  # which one sender's order does not allow
            return self._lose(LossReason.LATE)
        if before is None:
            run.came_late(rank)
            return self._lose(LossReason.LATE)
        run_before = before.runs[self._nodes[rank]]
        if timestamp < before.stamp or run_before.is_doubtful:
            run_before.came_late(rank)
            outcome = self._lose(LossReason.LATE)
        else:
            outcome = self._take(before, rank, data)
        run.follow(run_before)
        return outcome if period.tells_of(before) else outcome + self._close_before()

    def _take(self, period: SweepPeriod, rank: int, data: bytes) -> Results:
        run, torn = period.runs[self._nodes[rank]], ()
        if run.repeats(rank, data):
            return self._lose(LossReason.DUPLICATE)
        if len(period.runs) > 1 and not period.is_given and run.begins_anew(rank):
            torn = self._tear(period)
        if period.is_torn:
            outcome = torn + self._lose(LossReason.LATE)
        elif period.is_given or run.is_complete:
            outcome = self._lose(LossReason.SURPLUS)
        else:
            outcome = self._place(period, rank, data)
        run.note(rank, data)
        return outcome

    def _tear(self, period: SweepPeriod) -> Results:
        period.is_torn = True
        return self._lose(LossReason.LATE, sum(run.drop() for run in period.runs))

    def _place(self, period: SweepPeriod, rank: int, data: bytes) -> Results:
        dropped = period.runs[self._nodes[rank]].place(rank)
        outcome = () if dropped is None else self._lose(*dropped)
        if len(data) != self._lengths[rank]:
            reason = LossReason.SHORT if len(data) < self._lengths[rank] else LossReason.OVER_LONG
            return outcome + self._lose(reason)
        period.payload.words[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * rank + len(data)] = data
        period.payload.fresh[rank] = True
        return outcome

    def _end(self, period: SweepPeriod) -> Results:
        return self._lose(LossReason.LATE, sum(run.end() for run in period.runs))

    def _settle(self, period: SweepPeriod) -> Results:
        """The period is whole: what it has set aside is of the one before, or of none that counts."""
        if self._before is None:
            return self._lose(LossReason.LATE, sum(run.forget_aside() for run in period.runs))
        period.hand_back(self._before)
        return self._close_before()

    def _close_before(self) -> Results:
        before, self._before = self._before, None
        return () if before is None else self._give(before)

    def _give(self, period: SweepPeriod) -> Results:
        words, fresh = period.payload
        is_whole, period.is_given = bool(fresh.all()), True
        if self.drop_incomplete and not is_whole:
            self._counts['withheld'] += 1
            return self._lose(LossReason.INCOMPLETE, int(fresh.sum()))
        for node, run in enumerate(period.runs):
            self._used[node] += run.used
        values, status = self._codec.decode(words, fresh)
        self._counts['complete' if is_whole else 'incomplete'] += 1
        return (TaxelFrame(period.stamp, period.sequence, values, status, int((~fresh).sum())),)

    def _lose(self, reason: LossReason, can_frames: int = 1) -> Results:
        self._losses[reason] += can_frames
        return (Loss(reason, can_frames),) if can_frames else ()
