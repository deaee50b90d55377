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

from tactile_node.assembly.frame_source import LossReason
from tactile_node.assembly.pad_assembler import Frames, PadAssembler
from tactile_node.cia301.objects import MAX_PDO_BYTES
from tactile_node.skin.layout import EventDriven, SkinLayout

SILENCE = 5  #: event timers without a TPDO: of a working device more than lost ones


class SweepAssembler(PadAssembler):
    """The state machine of one pad that sends as ``event`` says."""

    def __init__(self, layout: SkinLayout, event: EventDriven, node_ids: Sequence[int]):
        super().__init__(layout, node_ids)
        self._event = event
        self._size = len(layout.tpdos)
        self._first: float | None = None  # stamp of the run
        self._words = bytearray()
        self._fresh = np.zeros(self._size, bool)
        self._is_given = True  # or there is none
        self._last = -1, b''  # rank and bytes received last
        self.restart()

    def start(self, node_id: int) -> None:
        """What the node sends next begins a run."""
        self._is_continued = False

    def end_period(self) -> Frames:
        frames, self._first = self._end(), None
        return frames

    def _feed_tpdo(self, rank: int, data: bytes, timestamp: float) -> Frames:
        is_within = self._is_within(timestamp)
        if is_within and (rank, data) == self._last:
            return self._lose(LossReason.DUPLICATE)
        frames: Frames = ()
        if not is_within or rank <= self._last[0]:
            frames = self._end()
            self._begin(timestamp)
        self._last = rank, data
        if wrong := self._wrong_length(rank, data):
            self._lose(wrong)
        else:
            self._words[MAX_PDO_BYTES * rank:MAX_PDO_BYTES * rank + len(data)] = data
            self._fresh[rank] = True
        return frames + self._end() if rank == self._size - 1 else frames

    def _pending(self) -> int:
        return 0 if self._is_given else int(self._fresh.sum())

    def _forget(self) -> None:
        self._lose(LossReason.UNFINISHED, self._pending())
        self._first = None
        self._is_given = True
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

    def _end(self) -> Frames:
        """Give the run under way, if there is one."""
        if self._is_given or self._first is None:
            return ()
        self._is_given = True
        if self._is_held_back:
            return self._lose(LossReason.LATE, int(self._fresh.sum()))
        return self._give(self._first, self._sequence, self._words, self._fresh)
