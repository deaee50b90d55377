"""Assemble the TPDOs that answer one SYNC into one taxel frame.

The assembler is a pure state machine without access to a bus or a clock.

Terms:

  - The *rank* of a TPDO is its position in the layout. A node sends its TPDOs in ascending rank, each once per SYNC.

  - A *sweep* consists of all TPDOs that the nodes of the pad send for one SYNC.

  - A *period* is the time between two SYNCs.

  - A *run* consists of TPDOs of one node in ascending rank. CAN preserves the order of each sender's frames, so each
    sweep of a node arrives as one run. A TPDO whose rank is not above the last rank begins the next run.

Each node of the pad is in one of two states:

                                           each SYNC before the last rank: 1 more
      IN STEP -- SYNC before the last rank: 1 sweep; changed order: unknown number -------------------> BEHIND
         ^                                                                                                |
         '-- further run in one period: 1 less, until 0; free bus before the only run, or NMT start: 0 ---'

For a node that is behind, the assembler knows only the largest number of sweeps that may still be on their way. The
assembler drops every TPDO that may answer another SYNC:

 1. If a node is in step, its run answers the last SYNC. The assembler adds the TPDOs to the sweep of that SYNC.

 2. If a node has not sent its last rank when the next SYNC is sent, the node may be one more sweep behind. The
    assembler then lets the TPDOs of the node wait. When the node begins a further run in the same period, the waiting
    TPDOs belong to an earlier sweep, and the node is one sweep less behind. After n silent periods, n runs are
    therefore lost (LATE) if they arrive within one period.

 3. If the node was in step and was sending when the SYNC was sent, it owes only the *tail* of its sweep, above the last
    rank. The assembler adds the waiting TPDOs to the sweep before as soon as the node begins its next run.

 4. TPDOs that still wait at the next SYNC are lost (LATE), because nothing shows which SYNC they answer. There is one
    exception. If the bus was free before the run, no answer to an earlier SYNC can arrive (``FreeBus``,
    ``bus_was_free``), and the run answers the last SYNC. If a second run arrives in the same period, an adapter has
    held frames back, and this conclusion was wrong.

 5. If a node in step begins a second run in one period and repeats a rank, a SYNC was lost. All TPDOs of the pad are
    then LATE until the next SYNC. If the node repeats no rank, the order of its TPDOs was changed. The TPDOs of the pad
    received so far are lost (OUT_OF_ORDER), and the node is behind by an unknown number of sweeps.

 6. A TPDO that repeats the previous TPDO byte for byte is a DUPLICATE and changes nothing.

 7. When a sweep is complete, the assembler emits the frame immediately. Further TPDOs in that period are SURPLUS.

 8. In an incomplete frame, the taxels that were not received are NaN and STALE. The assembler emits an incomplete
    frame, or withholds it (``drop_incomplete``), at the next SYNC, or as soon as no node owes a tail any more.

 9. With ``one_clock``, the same clock stamps TPDOs and SYNC. A TPDO stamped before the SYNC is then a part of the tail,
    or is LATE. Even a driver that lags behind its bus therefore never stamps taxels too late. ``_is_one_clock`` in
    ``skin_bus.py`` states for which interfaces this holds. For slcan it does not hold, so the other rules decide alone.

10. A SYNC that may have reached the bus more than MOST_LATE after its stamp begins a period as usual. The taxels of
    that period are not published: they are LATE.

Example of a pad with one node and the ranks 0, 1 and 2, and SYNC every 20 ms:

    =========  ==========  ==========================================================  ==========================
    time [ms]  CAN frames  node                                                        emitted
    =========  ==========  ==========================================================  ==========================
    0          SYNC        in step
    1 - 3      0 1 2                                                                   sweep of 0 ms, complete (7)
    20, 21     SYNC 0
    40         SYNC        behind by 1, and owes the tail 1 2 (3)
    41, 42     1 2         the TPDOs wait (2)
    43         0           in step, because a further run begins                       sweep of 20 ms, complete (3)
    44, 45     1 2                                                                     sweep of 40 ms, complete (7)
    60         SYNC
    80         SYNC        behind by 1, because it sent nothing after 60 ms (2)        sweep of 60 ms, all STALE (8)
    81 - 83    0 1 2       the TPDOs wait: they answer the SYNC of 60 or of 80 ms
    84         0           in step; the waiting TPDOs are LATE (2)
    85, 86     1 2                                                                     sweep of 80 ms, complete (7)
    =========  ==========  ==========================================================  ==========================

The numbers in parentheses are those of the rules.

A node is in doubt (``is_in_doubt``) if its last period ended with waiting TPDOs that were lost. The SYNC producer then
skips SYNCs, so that the bus becomes free.

Limits:

  - A frame can mix TPDOs of two periods in only two cases. In the first case, a SYNC, the end of one sweep and the
    beginning of the next sweep are all lost within two periods. In the second case, the bus or an adapter changes the
    order of a sender's frames, and the end of the previous sweep is lost.

  - After a skipped sweep, the assembler cannot detect a node that delays its answer beyond the next SYNC on a free bus.
    The assembler also cannot detect an adapter that holds some frames back for a whole period while it passes others.
    In both cases the stamps of the taxels are late by one period, or by more if the answer comes after further SYNCs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import inf

import numpy as np

from tactile_node.assembly.facts import LossReason, PadFacts
from tactile_node.assembly.health import TpdoOrder
from tactile_node.assembly.pad_assembler import PadAssembler, TaxelFrames
from tactile_node.assembly.sweep_sender import SweepSender
from tactile_node.cia301.objects import MAX_PDO_BYTES
from tactile_node.skin.layout import SkinLayout

#: Largest delay of a SYNC after its stamp [s]. Serial adapters take up to 16 ms to confirm that a SYNC was
#: sent.
MOST_LATE = 0.02


@dataclass
class Sweep:
    """The TPDOs of one pad that answer one SYNC, while they are being received."""

    sequence: int  #: sequence number of the SYNC
    stamp: float  #: stamp of the SYNC [s]
    missing: int  #: number of TPDOs not received yet; a TPDO of the wrong length counts as received

    #: True if no TPDO is used, because the TPDOs may answer another SYNC or the stamp may be wrong
    is_discarded: bool = False
    is_emitted: bool = False  #: True if the taxel frame was emitted or withheld
    tpdos: dict[int, bytes] = field(default_factory=dict)  #: data of each valid TPDO by rank

    @property
    def is_closed(self) -> bool:
        """True if the sweep takes no further TPDOs."""
        return self.is_discarded or self.is_emitted

    def discard(self) -> int:
        """Discard all TPDOs of the sweep, and return their number."""
        lost = len(self.tpdos)
        self.tpdos = {}
        self.is_discarded = True
        return lost


class SyncAssembler(PadAssembler):
    """The state machine of one pad whose TPDOs answer SYNC.

    The arguments are those of `PadAssembler`, and ``one_clock``, which is True if one clock stamps both TPDOs and SYNC.
    """

    answers_sync = True

    def __init__(self, layout: SkinLayout, node_ids: Sequence[int], one_clock: bool = True):
        super().__init__(layout, node_ids)
        self._one_clock = one_clock
        self._names = [tpdo.name for tpdo in layout.tpdos]  # by rank
        self._nodes = {node_id: SweepSender([rank for rank, tpdo in enumerate(layout.tpdos) if tpdo.node == node])
                       for node, node_id in enumerate(node_ids)}
        self._nodes_by_rank = [self._nodes[node_ids[tpdo.node]] for tpdo in layout.tpdos]
        self._syncs = 0
        self._distinct = [0] * len(layout.tpdos)  # number of TPDOs received without duplicates, by rank
        self._fresh = np.zeros(len(layout.tpdos), int)  # number of TPDOs used in frames, by rank

        self._sweep: Sweep | None = None  # answers the last SYNC
        self._before: Sweep | None = None  # answers the SYNC before, and its end may still arrive
        self.restart()

    @property
    def is_in_doubt(self) -> bool:
        return any(node.is_in_doubt for node in self._nodes.values())

    def restart(self) -> None:
        super().restart()
        self._restart_nodes()

    def resume(self, lost_periods: int) -> None:
        """Continue after an outage and skip ``lost_periods`` sequence numbers.

        All nodes are out of step, except the nodes for which ``node_started`` is called.
        """
        super().resume(lost_periods)
        self._restart_nodes(behind=inf)

    def node_started(self, node_id: int) -> None:
        if node_id in self._nodes:
            self._nodes[node_id].started()

    def bus_was_free(self) -> None:
        for node in self._nodes.values():
            node.bus_was_free()

    def sync(self, stamp: float, late: float = 0.0) -> TaxelFrames:
        """End the period and begin the next one. Return the frames whose missing TPDOs can no longer arrive.

        The arguments are those of `FreeBus.sync`.
        """
        frames = self._end_sweep()
        self._sequence += 1
        self._syncs += 1
        self._sweep = Sweep(self._sequence, stamp, len(self._names), is_discarded=late > MOST_LATE)
        return frames

    def end_period(self) -> TaxelFrames:
        frames = self._end_sweep() + self._close_before()
        self._sweep = None
        self._restart_nodes()
        return frames

    def facts(self) -> PadFacts:
        nodes = self._nodes.items()
        return replace(
            super().facts(),
            distinct_by_tpdo=tuple(tuple(self._distinct[rank] for rank in node.ranks) for _, node in nodes),
            orders=tuple(self._order(node_id, node) for node_id, node in nodes),
            fresh_by_tpdo=tuple(tuple(self._fresh[node.ranks].tolist()) for _, node in nodes),
            syncs=self._syncs)  # ``syncs`` is read last, because another thread may count at the same time

    def _order(self, node_id: int, node: SweepSender) -> TpdoOrder | None:
        sent = node.order
        if sent is None:
            return None
        return TpdoOrder(node_id, *(tuple(self._names[rank] for rank in ranks) for ranks in (sent, node.ranks)))

    def _feed_tpdo(self, rank: int, data: bytes, stamp: float) -> TaxelFrames:
        sweep, node = self._sweep, self._nodes_by_rank[rank]
        if sweep is None:
            return self._lose(LossReason.BEFORE_FIRST_SYNC)
        if self._one_clock and stamp < sweep.stamp:
            return self._feed_earlier(node, rank, data, stamp)
        if node.received and node.repeats(rank, data):
            return self._lose(LossReason.DUPLICATE)
        self._distinct[rank] += 1
        frames = self._begin_run(sweep, node, rank) if rank <= node.last else ()
        node.note(rank, data)
        if node.is_in_step:
            if sweep.is_closed:
                return frames + self._lose(LossReason.LATE if sweep.is_discarded else LossReason.SURPLUS)
            sweep.missing -= 1
        if (wrong := self._wrong_length(rank, data)) is not None:
            self._lose(wrong)
        elif not node.is_in_step:
            node.waiting[rank] = data
        else:
            sweep.tpdos[rank] = data
        return frames if sweep.missing else frames + self._emit_sweep(sweep)

    def _feed_earlier(self, node: SweepSender, rank: int, data: bytes, stamp: float) -> TaxelFrames:
        """Process a TPDO that was on the bus before the last SYNC."""
        if node.owes_tail and node.repeats(rank, data):
            return self._lose(LossReason.DUPLICATE)
        self._distinct[rank] += 1
        if node.received:  # a node cannot send a TPDO of an earlier period after a TPDO of this period
            return self._lose(LossReason.LATE)
        before = self._before if node.owes_tail else None
        is_tail = rank > node.last
        node.note_earlier(rank, data)
        if before is None:
            return self._lose(LossReason.LATE)
        if not is_tail or stamp < before.stamp:
            self._lose(LossReason.LATE, before.discard() + 1)
        elif (wrong := self._wrong_length(rank, data)) is not None:
            self._lose(wrong)
        else:
            before.tpdos[rank] = data
        return self._close_settled()

    def _begin_run(self, sweep: Sweep, node: SweepSender, rank: int) -> TaxelFrames:
        """Decide what the present run of a node was, because the node begins its next run in the same period."""
        if not node.is_in_step:
            self._use_waiting(node, self._before if node.owes_tail else None)
            node.began_further_run()
            return self._close_settled()
        if sweep.is_closed:
            return ()
        if rank in node.received:  # the SYNC between the two runs was lost
            self._lose(LossReason.LATE, sweep.discard())
            return self._close_before()
        self._lose(LossReason.OUT_OF_ORDER, sweep.discard())
        node.changed_order()
        return ()

    def _use_waiting(self, node: SweepSender, sweep: Sweep | None) -> TaxelFrames:
        """Move the waiting TPDOs of a node to ``sweep``. The TPDOs are lost if the sweep takes none."""
        waiting, node.waiting = node.waiting, {}
        if sweep is None or sweep.is_closed:
            return self._lose(LossReason.OUT_OF_ORDER if node.order else LossReason.LATE, len(waiting))
        sweep.tpdos |= waiting
        return ()

    def _end_sweep(self) -> TaxelFrames:
        """End the period, and close the sweeps whose missing TPDOs can no longer arrive."""
        frames, sweep = self._close_before(), self._sweep
        if sweep is None:
            return frames
        for node in self._nodes.values():
            self._use_waiting(node, sweep if node.end_period() else None)
        if not sweep.is_emitted:
            self._before = sweep
        return frames + self._close_settled()

    def _close_settled(self) -> TaxelFrames:
        """Emit the sweep before the last SYNC if it can receive no further TPDOs."""
        if self._before is None:
            return ()
        is_open = not self._before.is_discarded and any(node.owes_tail for node in self._nodes.values())
        return () if is_open else self._close_before()

    def _close_before(self) -> TaxelFrames:
        before, self._before = self._before, None
        return () if before is None else self._emit_sweep(before)

    def _emit_sweep(self, sweep: Sweep) -> TaxelFrames:
        sweep.is_emitted = True
        payload = bytearray(MAX_PDO_BYTES * len(self._names))
        fresh = np.zeros(len(self._names), bool)
        for rank, data in sweep.tpdos.items():
            payload[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * rank + len(data)] = data
        fresh[list(sweep.tpdos)] = True
        self._fresh += fresh
        return self._emit_or_withhold(sweep.stamp, sweep.sequence, payload, fresh)

    def _restart_nodes(self, behind: float = 0) -> None:
        for node in self._nodes.values():
            node.restart(behind)

    def _forget(self) -> None:
        self._lose(LossReason.UNFINISHED, self._pending())
        for node in self._nodes.values():
            node.waiting = {}
        self._before = self._sweep = None

    def _pending(self) -> int:
        open_sweeps = (sweep for sweep in (self._before, self._sweep) if sweep is not None and not sweep.is_emitted)
        return sum(len(sweep.tpdos) for sweep in open_sweeps) + sum(len(node.waiting) for node in self._nodes.values())
