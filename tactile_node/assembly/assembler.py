"""Assembles the TPDOs between two SYNCs into one taxel frame. A pure state machine: no bus, no clock.

Terms
    rank      a TPDO's place in the layout; a node sends its TPDOs in ascending rank, each once a SYNC
    sweep     the TPDOs that the pad's nodes send for one SYNC
    period    the time between two SYNCs
    run       TPDOs of one node in ascending rank; CAN keeps the order of one sender, so a sweep is one run

Rules, for each node of the pad separately
 1. A taxel frame is made of one run of each node.
 2. A rank that is not above the last one begins the next run. The run before is lost: LATE where it was suspect or
    already held that rank, else OUT_OF_ORDER. Only an immediate repetition with equal bytes is a DUPLICATE and
    changes nothing.
 3. A run is *suspect* while its node may be behind. After a period that ended early, only ranks above its end may be
    its delayed tail; after a silent period, any rank may.
    - If a complete run follows before the next SYNC, the suspect run is of the period before, and goes back to it.
      Where it can only be the tail of a run, it does so when the next run begins: a sender keeps its order. That does
      not hold for ORDER_MEMORY periods after the order was seen to be changed (OUT_OF_ORDER).
    - Otherwise it is lost (LATE): nothing proves that it is of this period.
    - After n silent periods, n runs are therefore lost when they come within one period; otherwise all runs until a
      free bus proves that nothing is late (rule 8).
    - A node that was just started (``start``) is not behind.
 4. When the runs of all nodes are complete, the frame is emitted at once. TPDOs that follow in that period are SURPLUS.
 5. An incomplete frame has NaN and STALE for the taxels that are in no run. It is emitted, or withheld
    (``drop_incomplete``), as soon as nothing more of it can come: at the next SYNC, when the next run begins, or one
    SYNC later.
 6. With ``one_clock``, TPDOs and SYNC are stamped by one clock. A TPDO stamped before the SYNC is then of the period
    before, or LATE: a driver that lags behind its bus never publishes taxels under a later stamp.
 7. With several nodes, a next run of a node that is not suspect proves that a SYNC was lost. The period is discarded:
    all TPDOs of all nodes are LATE until the next SYNC.
 8. A node that has an answer to a SYNC to send begins within half a period while the bus is free. A bus that was free
    for longer, after TPDOs of that period, therefore proves that no run of it comes any more (``FreeBus``, ``settle``).
    The next run is of the period in which it comes, unless another follows in it: then an adapter was held up. While
    it is not known how far a node is (``is_in_doubt``), the SYNC producer leaves out SYNCs, so that the bus is free.
 9. A SYNC that may have been on the bus more than MOST_LATE after its stamp begins a period like any other, but the
    taxels of that period are not given: they are LATE.

Limits
  - A frame mixes two periods only if a SYNC, the end of one sweep and the beginning of the next one are lost within
    two periods, or where bus or adapter change the order of a sender for the first time, and the end of the sweep
    before is lost.
  - A node that answers on a free bus after the next SYNC, or an adapter that holds frames back for that long in the
    midst of them, is not detected once a sweep was left out. Its taxels are then stamped as late as it answers: one
    period, or more if it answers after further SYNCs.
"""

from collections.abc import Sequence

import numpy as np

from tactile_node.assembly.frame_source import LossReason, PadStatistics
from tactile_node.assembly.health import TpdoOrder
from tactile_node.assembly.pad_assembler import Frames, PadAssembler
from tactile_node.assembly.sweep_period import SweepPeriod
from tactile_node.cia301.objects import MAX_PDO_BYTES
from tactile_node.skin.layout import SkinLayout

ORDER_MEMORY = 100  #: periods after a change of order; a lost SYNC can look like one
MOST_LATE = 0.02  #: s by which a SYNC may follow its stamp; serial adapters take up to 16 ms to say that it was sent


class FrameAssembler(PadAssembler):
    """The state machine of one pad whose TPDOs answer SYNC."""

    def __init__(self, layout: SkinLayout, node_ids: Sequence[int], one_clock: bool = True):
        super().__init__(layout, node_ids)
        self._one_clock = one_clock
        self._node_ids = tuple(node_ids)
        self._nodes = [tpdo.node for tpdo in layout.tpdos]  # by rank
        self._layout_orders = [[rank for rank, tpdo in enumerate(layout.tpdos) if tpdo.node == node]
                               for node in range(len(node_ids))]
        self._ranks_of_nodes = [np.array(ranks) for ranks in self._layout_orders]
        self._names = [tpdo.name for tpdo in layout.tpdos]  # by rank
        self._orders = list(self._layout_orders)  # in which the TPDOs of each node came
        self._syncs = 0
        self._distinct = [0] * len(layout.tpdos)  # by rank
        self._fresh = np.zeros(len(layout.tpdos), int)  # by rank
        self._before: SweepPeriod | None = None  # not yet emitted: its end may still come
        self._period: SweepPeriod | None = None
        self.restart()

    @property
    def is_in_doubt(self) -> bool:
        """Whether a bus without SYNC has to show how far a node is. From any thread."""
        period = self._period
        return period is not None and any(run.is_in_doubt for run in period.runs)

    def restart(self) -> None:
        super().restart()
        self._is_after_outage = False
        self._changed_order = -ORDER_MEMORY - 1  # sequence number at which bus or adapter last did

    def resume(self, lost_periods: int) -> None:
        """How far the nodes are is not known after an outage, except of those that ``start`` names."""
        super().resume(lost_periods)
        self._is_after_outage = True

    def start(self, node_id: int) -> None:
        """This node, which did not send, was started: no TPDO of an earlier period can come from it."""
        if self._period is not None and node_id in self._node_ids:
            self._period.runs[self._node_ids.index(node_id)].start()

    def sync(self, timestamp: float, late: float = 0.0) -> Frames:
        """A SYNC was on the bus: end the period and begin the next one; the frames to which nothing more can come."""
        frames, period = self._close_before(), self._period
        self._note_orders()
        if period is not None and not period.is_emitted:
            self._lose(LossReason.LATE, sum(run.end() for run in period.runs))
            if period.may_be_continued:
                self._before = period
            else:
                frames += self._emit(period)
        self._sequence += 1
        self._syncs += 1
        self._period = SweepPeriod(self._sequence, timestamp, self._ranks_of_nodes, period)
        self._period.is_stamp_wrong = late > MOST_LATE
        if self._is_after_outage:
            self._is_after_outage = False
            for run in self._period.runs:
                run.assume_behind()
        return frames

    def settle(self) -> None:
        """A free bus has proved that no answer to an earlier SYNC is to come (``FreeBus``)."""
        for run in () if self._period is None else self._period.runs:
            run.settle()

    def end_period(self) -> Frames:
        frames, period = self._close_before(), self._period
        self._note_orders()
        if period is not None and not period.is_emitted:
            self._lose(LossReason.LATE, sum(run.end() for run in period.runs))
            frames += self._emit(period)
        self._period = None
        return frames

    def statistics(self) -> PadStatistics:
        return super().statistics()._replace(
            distinct_by_tpdo=tuple(tuple(self._distinct[rank] for rank in own) for own in self._ranks_of_nodes),
            orders=tuple(map(self._order, self._node_ids, self._orders, self._layout_orders)),
            fresh_by_tpdo=tuple(tuple(self._fresh[own].tolist()) for own in self._ranks_of_nodes),
            syncs=self._syncs)  # after what they have caused, for another thread counts on meanwhile

    def _order(self, node_id: int, sent: list[int], layout: list[int]) -> TpdoOrder | None:
        if sent == layout:
            return None
        return TpdoOrder(node_id, *(tuple(self._names[rank] for rank in ranks) for ranks in (sent, layout)))

    def _note_orders(self) -> None:
        """Note in which order the TPDOs of each node came, if each came once in this period.

        The end of a late sweep followed by the beginning of the next one looks like another order. So the assembler
        takes another order for one only if no sweep can be late: after OUT_OF_ORDER or, with several nodes, in a
        discarded period. As long as a node keeps that order, the assembler takes no sweep for a late one.
        """
        period = self._period
        if period is None:
            return
        for node, run in enumerate(period.runs):
            order, layout_order = run.received, self._layout_orders[node]
            is_proved = order == layout_order or self._changed_order == self._sequence or period.is_discarded
            if sorted(order) == layout_order and is_proved:
                self._orders[node] = order
            elif order == self._orders[node]:
                self._changed_order = self._sequence

    def _feed_tpdo(self, rank: int, data: bytes, timestamp: float) -> Frames:
        period = self._period
        if period is None:
            return self._lose(LossReason.BEFORE_FIRST_SYNC)
        self._distinct[rank] += 1
        if self._one_clock and timestamp < period.stamp:
            return self._feed_before(period, rank, data, timestamp)
        self._take(period, rank, data)
        if self._before is not None and self._sequence - self._changed_order >= ORDER_MEMORY:
            period.return_aside(self._before, only_proved=True)
        if period.runs[self._nodes[rank]].is_complete and period.is_complete:
            return self._resolve_aside(period) + self._emit(period)
        if self._before is not None and not period.may_continue(self._before):
            return self._close_before()
        return ()

    def _forget(self) -> None:
        self._lose(LossReason.UNFINISHED, self._pending())
        self._before = self._period = None

    def _pending(self) -> int:
        return sum(period.pending for period in (self._before, self._period) if period is not None)

    def _feed_before(self, period: SweepPeriod, rank: int, data: bytes, timestamp: float) -> Frames:
        """A TPDO that was on the bus before the last SYNC."""
        before, run = self._before, period.runs[self._nodes[rank]]
        if run.is_seen:  # the order of one sender does not allow it
            return self._lose(LossReason.LATE)
        if before is None:
            run.note_late(rank)
            return self._lose(LossReason.LATE)
        run_before = before.runs[self._nodes[rank]]
        if timestamp < before.stamp or run_before.is_position_unknown:
            run_before.note_late(rank)
            self._lose(LossReason.LATE)
        else:
            self._take(before, rank, data)
        run.carry_over(run_before)
        return () if period.may_continue(before) else self._close_before()

    def _take(self, period: SweepPeriod, rank: int, data: bytes) -> None:
        run = period.runs[self._nodes[rank]]
        if run.repeats(rank, data):
            self._distinct[rank] -= 1
            self._lose(LossReason.DUPLICATE)
            return
        if len(period.runs) > 1 and not period.is_emitted and run.begins_next_sweep(rank):
            period.is_discarded = True  # a SYNC was lost within it: of no TPDO is known to which period it belongs
            self._lose(LossReason.LATE, sum(run.lose() for run in period.runs))
        if period.is_discarded:
            self._lose(LossReason.LATE)
        elif period.is_emitted or run.is_complete:
            self._lose(LossReason.SURPLUS)
        else:
            self._place(period, rank, data)
        run.note_received(rank, data)

    def _place(self, period: SweepPeriod, rank: int, data: bytes) -> None:
        if (lost := period.runs[self._nodes[rank]].add(rank)) is not None:
            self._lose(*lost)
        if (wrong := self._wrong_length(rank, data)) is not None:
            self._lose(wrong)
            return
        period.payload.words[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * rank + len(data)] = data
        period.payload.fresh[rank] = True

    def _resolve_aside(self, period: SweepPeriod) -> Frames:
        """The period is complete: the runs that it has set aside are of the one before, or of an older one."""
        if self._before is None:
            return self._lose(LossReason.LATE, sum(run.lose_aside() for run in period.runs))
        period.return_aside(self._before)
        return self._close_before()

    def _close_before(self) -> Frames:
        before, self._before = self._before, None
        return () if before is None else self._emit(before)

    def _emit(self, period: SweepPeriod) -> Frames:
        words, fresh = period.payload
        period.is_emitted = True
        if period.is_stamp_wrong:
            self._lose(LossReason.LATE, int(fresh.sum()))
            fresh[:] = False
        self._fresh += fresh
        return self._give(period.stamp, period.sequence, words, fresh)

    def _lose(self, reason: LossReason, can_frames: int = 1) -> Frames:
        if reason is LossReason.OUT_OF_ORDER:
            self._changed_order = self._sequence
        return super()._lose(reason, can_frames)
