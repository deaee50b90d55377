"""Assemble the TPDOs that answer one SYNC into one taxel frame.

The assembler is a pure state machine without access to a bus or a clock.

Terms:

  - The *rank* of a TPDO is its position in the layout. A node sends its TPDOs in ascending rank, each once per SYNC.

  - A *sweep* consists of all TPDOs that the nodes of the pad send for one SYNC.

  - A *period* is the time between two SYNCs.

  - A *run* consists of TPDOs of one node in ascending rank. CAN preserves the order of each sender's frames, so each
    sweep of a node arrives as one run.

The assembler applies these rules to each node of the pad separately:

 1. A taxel frame consists of one run from each node.

 2. If the rank of a TPDO is not above the last rank, the TPDO begins the next run, and the previous run is lost. The
    loss is counted as LATE if the previous run was suspect or already held that rank, and otherwise as OUT_OF_ORDER. A
    TPDO that repeats the previous TPDO byte for byte is a DUPLICATE and changes nothing.

 3. A run is *suspect* while its node may be behind, because the run may then belong to an earlier period. If the
    previous period ended in the middle of a sweep, the missing ranks may still arrive as a delayed tail. If the
    previous period was silent, any ranks may arrive late.

    - If a complete run follows before the next SYNC, the suspect run belongs to the previous period, and the assembler
      moves it there. A suspect run that can only be the tail of a sweep is moved as soon as the next run begins,
      because CAN preserves the order of each sender's frames. The assembler does not take this shortcut for
      ORDER_MEMORY periods after it has seen a change of order (OUT_OF_ORDER).

    - If no complete run follows, the suspect run is lost (LATE), because nothing proves that it belongs to this period.

    - After n silent periods, n runs are therefore lost if they arrive within one period. If late runs arrive over
      several periods, all runs are lost until a free bus proves that nothing is late (rule 8).

    - A node that was just started (``start``) is not behind.

 4. When the runs of all nodes are complete, the assembler emits the frame immediately. Further TPDOs in that period are
    SURPLUS.

 5. In an incomplete frame, the taxels that no run contains are NaN and STALE. An incomplete frame is emitted, or
    withheld (``drop_incomplete``), as soon as none of its missing TPDOs can arrive any more. The assembler decides at
    the next SYNC, when the next run begins, or one SYNC later.

 6. With ``one_clock``, the same clock stamps TPDOs and SYNC. A TPDO stamped before the SYNC then belongs to the
    previous period, or is LATE. Even a driver that lags behind its bus therefore never stamps taxels too late.

 7. If a pad has several nodes and a node that is not suspect begins another run within a period, a SYNC was lost. The
    assembler discards the period: all TPDOs of all nodes are LATE until the next SYNC.

 8. While the bus is free, a node begins its answer to a SYNC within half a period. If TPDOs of a period were received
    and the bus was then free for more than half a period, no further run of that period can arrive (``FreeBus``,
    ``settle``). The next run then belongs to the period in which it arrives. If a second run arrives in the same
    period, an adapter has held frames back, and the conclusion was wrong. While the assembler does not know which SYNC
    a node is answering (``is_in_doubt``), the SYNC producer skips SYNCs, so that the bus becomes free.

 9. If a SYNC may have reached the bus more than MOST_LATE after its stamp, it begins a period as usual. The taxels of
    that period are not published: they are LATE.

Limits:

  - A frame can mix TPDOs of two periods in only two cases. In the first case, a SYNC, the end of one sweep and the
    beginning of the next sweep are all lost within two periods. In the second case, the bus or an adapter changes the
    order of a sender's frames for the first time, and the end of the previous sweep is lost.

  - After a skipped sweep, the assembler cannot detect a node that delays its answer beyond the next SYNC on a free bus.
    The assembler also cannot detect an adapter that holds some frames back for a whole period while it passes others.
    In both cases the stamps of the taxels are late by one period, or by more if the answer comes after further SYNCs.
"""

from collections.abc import Sequence

import numpy as np

from tactile_node.assembly.frame_source import LossReason, PadStatistics
from tactile_node.assembly.health import TpdoOrder
from tactile_node.assembly.pad_assembler import Frames, PadAssembler
from tactile_node.assembly.sweep_period import SweepPeriod
from tactile_node.cia301.objects import MAX_PDO_BYTES
from tactile_node.skin.layout import SkinLayout

#: Number of periods for which the assembler remembers a change of order. A lost SYNC can look like a change of order.
ORDER_MEMORY = 100
#: Largest delay of a SYNC after its stamp [s]. Serial adapters take up to 16 ms to confirm that a SYNC was
#: sent.
MOST_LATE = 0.02


class FrameAssembler(PadAssembler):
    """The state machine of one pad whose TPDOs answer SYNC.

    Parameters
    ----------
    layout : SkinLayout
        Layout of the pad.
    node_ids : sequence of int
        Node-IDs of the pad, one for each node of the layout.
    one_clock : bool
        True if one clock stamps both TPDOs and SYNC.
    """

    def __init__(self, layout: SkinLayout, node_ids: Sequence[int], one_clock: bool = True):
        super().__init__(layout, node_ids)
        self._one_clock = one_clock
        self._node_ids = tuple(node_ids)
        self._nodes = [tpdo.node for tpdo in layout.tpdos]  # node number by rank
        self._layout_orders = [[rank for rank, tpdo in enumerate(layout.tpdos) if tpdo.node == node]
                               for node in range(len(node_ids))]
        self._ranks_of_nodes = [np.array(ranks) for ranks in self._layout_orders]
        self._names = [tpdo.name for tpdo in layout.tpdos]  # TPDO name by rank
        self._orders = list(self._layout_orders)  # order in which the TPDOs of each node arrive
        self._syncs = 0
        self._distinct = [0] * len(layout.tpdos)  # number of TPDOs received without duplicates, by rank
        self._fresh = np.zeros(len(layout.tpdos), int)  # number of TPDOs used in frames, by rank

        # previous period, not emitted yet because the end of its sweep may still arrive
        self._before: SweepPeriod | None = None
        self._period: SweepPeriod | None = None
        self.restart()

    @property
    def is_in_doubt(self) -> bool:
        """True if no SYNC may be sent until the driver knows how far each node has got.

        Any thread may read this property.
        """
        period = self._period
        return period is not None and any(run.is_in_doubt for run in period.runs)

    def restart(self) -> None:
        super().restart()
        self._is_after_outage = False
        self._changed_order = -ORDER_MEMORY - 1  # sequence number of the period with the last change of order

    def resume(self, lost_periods: int) -> None:
        """Continue after an outage and skip ``lost_periods`` sequence numbers.

        Any node may be behind, except the nodes for which ``start`` is called.
        """
        super().resume(lost_periods)
        self._is_after_outage = True

    def start(self, node_id: int) -> None:
        """Record that a silent node was started. The next TPDOs of that node do not belong to an earlier period."""
        if self._period is not None and node_id in self._node_ids:
            self._period.runs[self._node_ids.index(node_id)].start()

    def sync(self, timestamp: float, late: float = 0.0) -> Frames:
        """End the period and begin the next one, because a SYNC was sent on the bus.

        Parameters
        ----------
        timestamp : float
            Stamp of the SYNC [s].
        late : float
            Largest delay of the SYNC after its stamp [s].

        Returns
        -------
        tuple of TaxelFrame
            Frames whose missing TPDOs can no longer arrive.
        """
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
        """Record that a free bus has proved that no answer to an earlier SYNC can arrive (``FreeBus``)."""
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
            syncs=self._syncs)  # ``syncs`` is read last, because another thread may count at the same time

    def _order(self, node_id: int, sent: list[int], layout: list[int]) -> TpdoOrder | None:
        if sent == layout:
            return None
        return TpdoOrder(node_id, *(tuple(self._names[rank] for rank in ranks) for ranks in (sent, layout)))

    def _note_orders(self) -> None:
        """Record the order in which the TPDOs of each node arrived, if each TPDO arrived once in this period.

        The end of a late sweep and the beginning of the next one look like a changed order. The assembler therefore
        accepts a changed order only if no sweep can be late. No sweep can be late after OUT_OF_ORDER or, with several
        nodes, in a discarded period. As long as a node keeps the changed order, the assembler treats none of the node's
        sweeps as late.
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
        """Process a TPDO that was on the bus before the last SYNC."""
        before, run = self._before, period.runs[self._nodes[rank]]
        if run.is_seen:  # a node cannot send a TPDO of an earlier period after a TPDO of this period
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
            period.is_discarded = True  # a SYNC was lost, so the period of each TPDO is unknown
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
        """Move the runs that were set aside back to the previous period, because this period is complete.

        If the previous period has already been emitted, the runs belong to an even earlier period and are LATE.
        """
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
