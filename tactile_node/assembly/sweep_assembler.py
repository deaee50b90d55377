"""Recognises the sweeps of a skin that sends without SYNC. A pure state machine: no bus, no clock.

The device sends all TPDOs of one scan together, in ascending rank, and begins the next sweep a ``period`` later or
more. CAN keeps the order of one sender.

Rules
 1. A taxel frame is made of one run: TPDOs in ascending rank, stamped within ``sweep_time`` of the first of them.
 2. A TPDO whose rank is not above the last one, or which is stamped later or earlier, begins the next run. Only an
    immediate repetition with equal bytes within that time is a DUPLICATE and changes nothing.
 3. A run is given with its last rank, or when the next one begins. Taxels that are in none of its TPDOs are NaN and
    STALE; with ``drop_incomplete`` the frame is withheld.
 4. Its stamp is that of its first TPDO received: later than the scan by the time that the device takes to send it,
    and by ``sweep_time`` at most where its first TPDOs are lost.
 5. With an event timer, a pause is counted in ``sequence`` as the sweeps that should have come. After SILENCE of
    them what comes may have waited in an adapter: it is LATE until a run begins more than ``sweep_time`` after the one
    before.

Two sweeps are never mixed while each takes less than ``sweep_time`` from its beginning to its last stamp: the first
TPDO received is then stamped at most ``sweep_time`` after the sweep began, the run ends ``sweep_time`` later, and twice
that is less than the period (``SWEEP_SHARE``). Limit: stamps that are delayed by more, as by an adapter that hands over
many frames at once, and at the same time the end of one sweep and the beginning of the next one lost.
"""

from collections.abc import Sequence

import numpy as np

from tactile_node.assembly.frame_source import LossReason, PadStatistics, Results
from tactile_node.assembly.tpdo_table import PadCounts, TpdoTable
from tactile_node.cia301.objects import MAX_PDO_BYTES
from tactile_node.skin.layout import EventDriven, SkinLayout
from tactile_node.skin.taxel_codec import TaxelCodec
from tactile_node.taxel_frame import TaxelFrame

SILENCE = 5  #: event timers without a TPDO: of a working device more than lost ones


class SweepAssembler:
    """The state machine of one pad that sends as ``event`` says; its methods are those of ``FrameAssembler``."""

    service = 'tpdo'  #: under which its CAN frames are counted

    def __init__(self, layout: SkinLayout, event: EventDriven, node_ids: Sequence[int], drop_incomplete: bool = False):
        self.drop_incomplete = drop_incomplete
        self._event = event
        self._codec = TaxelCodec(layout)
        self._table = TpdoTable(layout, node_ids)
        self._counts = PadCounts(layout)
        self._size = len(layout.tpdos)
        self._pending = 0
        self._first: float | None = None  # stamp of the run
        self._last = -1, b''  # rank and bytes received last
        self._words = bytearray()
        self._fresh = np.zeros(self._size, bool)
        self.restart()

    @property
    def can_ids(self) -> frozenset[int]:
        return self._table.can_ids

    def restart(self) -> None:
        """Forget the run under way; the next one is number 0."""
        self._forget()
        self._sequence = -1

    def resume(self, lost_periods: int) -> None:
        """After an outage: forget the run under way, leave out ``lost_periods`` sequence numbers."""
        self._forget()
        self._sequence += lost_periods

    def start(self, node_id: int) -> None:
        """The node was started: what it sends next begins a run."""
        self._is_continued = False

    def sync(self, timestamp: float) -> Results:
        """Has no effect."""
        return ()

    def feed(self, can_id: int, data: bytes, timestamp: float) -> Results:
        """One TPDO of this pad: the frames that it completes or ends, losses, or nothing (taken, more to come)."""
        self._counts.received += 1
        rank = self._table.rank(can_id, data)
        if isinstance(rank, LossReason):
            return self._counts.lose(rank)
        is_within = self._is_within(timestamp)
        if is_within and (rank, data) == self._last:
            return self._counts.lose(LossReason.DUPLICATE)
        results: Results = ()
        if not is_within or rank <= self._last[0]:
            results = self._end()
            self._begin(timestamp)
        self._last = rank, data
        if wrong := self._table.wrong_length(rank, data):
            results += self._counts.lose(wrong)
        else:
            self._words[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * rank + len(data)] = data
            self._fresh[rank] = True
            self._pending += 1
        return results + self._end() if rank == self._size - 1 else results

    def end_period(self) -> Results:
        """End the run under way without a next one (end of a log); its frame."""
        results, self._first = self._end(), None
        return results

    def statistics(self) -> PadStatistics:
        return self._counts.statistics(self._pending)

    def _forget(self) -> None:
        self._counts.lose(LossReason.UNFINISHED, self._pending)
        self._pending = 0
        self._first = None
        self._is_given = True  # or there is none
        self._is_continued = False  # what comes may be of the run
        self._is_held_back = False  # the run may have waited in an adapter
        self._last = -1, b''

    def _is_within(self, stamp: float) -> bool:
        """Whether what is stamped so may be of the run under way."""
        return (self._is_continued and self._first is not None
                and 0 <= stamp - self._first <= self._event.sweep_time)

    def _begin(self, stamp: float) -> None:
        timer, steps = self._event.event_timer, 1
        if timer and self._first is not None:
            pause = stamp - self._first
            steps = max(1, int(pause / timer + 0.5))
            is_backlog = 0 <= pause <= self._event.sweep_time  # no device begins two sweeps so soon
            self._is_held_back = is_backlog if self._is_held_back else pause > SILENCE * timer
        self._sequence += steps
        self._first = stamp
        self._words = bytearray(MAX_PDO_BYTES * self._size)
        self._fresh = np.zeros(self._size, bool)
        self._is_continued, self._is_given = True, False

    def _end(self) -> Results:
        """Give the run under way, if there is one."""
        if self._is_given or self._first is None:
            return ()
        self._is_given = True
        pending, self._pending = self._pending, 0
        if self._is_held_back:
            return self._counts.lose(LossReason.LATE, pending)
        missing = self._size - int(self._fresh.sum())
        if missing and self.drop_incomplete:
            self._counts.withhold(missing)
            return self._counts.lose(LossReason.INCOMPLETE, pending)
        self._counts.give(self._fresh, missing)
        values, status = self._codec.decode(self._words, self._fresh)
        return (TaxelFrame(self._first, self._sequence, values, status, missing_can_frames=missing),)
